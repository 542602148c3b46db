"""Where frames come from: videos, folders of images, GenICam and Basler cameras."""
