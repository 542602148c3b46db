// A robot in Fast DDS: joint states out at 1 kHz, trajectories in; counts what came back right.
//
//     peer DOMAIN COUNT
//
// Reading k has positions k + 0.25 j and velocities -k; the answer to it is to name its stamp as
// its frame and to have its positions as torques. Prints sent, answered and wrong, each once.

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include "messagesPubSubTypes.h"

using namespace eprosima::fastdds::dds;
using sensor_msgs::msg::dds_::JointState_;
using trajectory_msgs::msg::dds_::JointTrajectory_;

static const int kJoints = 3;

class Answers : public DataReaderListener {
public:
    std::atomic<long> answered{0}, wrong{0};
    std::vector<char> seen;

    explicit Answers(long count) : seen(count, 0) {}

    void on_data_available(DataReader* reader) override {
        JointTrajectory_ said;
        SampleInfo info;
        while (reader->take_next_sample(&said, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            const double answers = std::strtod(said.header().frame_id().c_str(), nullptr);
            const long k = std::lround(answers * 1e3) - 1000L;
            bool good = k >= 0 && k < static_cast<long>(seen.size()) && said.points().size() == 1
                     && said.points()[0].effort().size() == kJoints;
            for (int j = 0; good && j < kJoints; ++j)
                good = said.points()[0].effort()[j] == k + 0.25 * j;
            if (!good || seen[k]) ++wrong;
            else { seen[k] = 1; ++answered; }
        }
    }
};

int main(int argc, char** argv) {
    if (argc != 3) return 2;
    const long count = std::atol(argv[2]);
    DomainParticipantQos qos;
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    auto* participant =
        DomainParticipantFactory::get_instance()->create_participant(std::atoi(argv[1]), qos);
    if (!participant) return 1;
    TypeSupport states(new sensor_msgs::msg::dds_::JointState_PubSubType());
    TypeSupport orders(new trajectory_msgs::msg::dds_::JointTrajectory_PubSubType());
    states.register_type(participant);
    orders.register_type(participant);
    auto* out = participant->create_topic("rt/joint_states", states.get_type_name(), TOPIC_QOS_DEFAULT);
    auto* in = participant->create_topic("rt/peer/joint_trajectory", orders.get_type_name(),
                                         TOPIC_QOS_DEFAULT);
    DataWriterQos writing = DATAWRITER_QOS_DEFAULT;
    writing.reliability().kind = BEST_EFFORT_RELIABILITY_QOS;  // ROS 2 sensor data
    writing.history().depth = 5;
    DataReaderQos reading = DATAREADER_QOS_DEFAULT;
    reading.reliability().kind = RELIABLE_RELIABILITY_QOS;
    reading.history().depth = 10;
    Answers answers(count);
    auto* writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(out, writing);
    participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(in, reading, &answers);

    std::printf("ready\n");
    std::fflush(stdout);
    std::getchar();  // until the other side has found us
    JointState_ said;
    said.name({"a", "b", "c"});
    auto due = std::chrono::steady_clock::now();
    for (long k = 0; k < count; ++k) {
        said.header().stamp().sec((k + 1000) / 1000);
        said.header().stamp().nanosec(((k + 1000) % 1000) * 1000000u);
        said.position().clear();
        for (int j = 0; j < kJoints; ++j) said.position().push_back(k + 0.25 * j);
        said.velocity().assign(kJoints, -static_cast<double>(k));
        writer->write(&said);
        due += std::chrono::milliseconds(1);
        std::this_thread::sleep_until(due);
    }
    std::this_thread::sleep_for(std::chrono::seconds(1));
    std::printf("sent %ld answered %ld wrong %ld\n", count, answers.answered.load(),
                answers.wrong.load());
    return 0;
}
