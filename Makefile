# make catch    throw balls at the simulated arm and write runs/0-direct/report.html
# make test     run the tests
# make bare     run each command of the README and the tutorials without any extra
# make extras   add all extras to .venv
# make docs     build the documentation site: build/docs/index.html
# make soak     fuzz envelope, ticks, calls and readers: COMMANDS=N TICKS=N CALLS=N FILES=N PROCESSES=N KILLS=N RUN_KILLS=N RUN_SIGNALS=N STUDY_KILLS=N SWINGS=N SEED=S
# make thorough run further cases, as each bad value of each option: half an hour
# make controllers  try the drivers of Franka and UR at the makers' clients, in an environment of their own: ARGS="--throws N"
# make lint     format, lint, types, import contracts
# make check    make lint, then make test
# Each builds .venv with exactly pinned versions first if it is missing; Python >= 3.11 is enough.

PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check --constraint constraints.txt
# uv takes a third of pip's time, but does not read pip's settings: where it finds no packages, pip does it.
install = $(BIN)/uv pip install --quiet --python $(BIN)/python --constraint constraints.txt $(1) 2>/dev/null || $(PIP) $(1)
COMMANDS ?= 20000000
TICKS ?= 5000
CALLS ?= 20000
FILES ?= 300
PROCESSES ?= 6
KILLS ?= 3
RUN_KILLS ?= 2
RUN_SIGNALS ?= 4
STUDY_KILLS ?= 2
SWINGS ?= 70
SEED ?= 1

.PHONY: catch test thorough bare extras lint check bench docs soak controllers clean

.venv/ready: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "mitt needs Python 3.11 or later")'
	$(PYTHON) -m venv .venv
	$(PIP) uv
	$(call install,"setuptools>=80")
	$(call install,--no-build-isolation --editable .)
	touch .venv/ready

# What catching does not need: tests and checks, cameras, studies, rivals.
.venv/complete: .venv/ready
	$(call install,--no-build-isolation --editable ".[dev]")
	touch .venv/complete

.venv/documented: .venv/ready
	$(call install,--no-build-isolation --editable ".[docs]")
	touch .venv/documented

catch: .venv/ready
	$(BIN)/mitt catch --overwrite $(ARGS)

test: .venv/complete
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal $(ARGS)

thorough: .venv/complete
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal -m thorough $(ARGS)

bare: .venv/ready
	$(BIN)/python tests/bare_run.py

extras: .venv/complete

lint: .venv/complete
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/bandit --quiet --recursive --severity-level medium src

check: lint
	$(MAKE) --no-print-directory test

bench: .venv/complete
	$(BIN)/mitt bench

docs: .venv/documented
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet --builder html docs build/docs

# franka-sim wants an older NumPy and MuJoCo than mitt, and franky-sim has the arm's model.
build/controllers/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv build/controllers/client
	build/controllers/client/bin/python -m pip install --quiet --constraint constraints.txt --editable ".[franka,ur]"
	$(PYTHON) -m venv build/controllers/server
	build/controllers/server/bin/python -m pip install --quiet franka-sim==1.1.7
	build/controllers/server/bin/python -m pip install --quiet --no-deps franky-sim==1.0.4
	touch build/controllers/ready

controllers: build/controllers/ready
	build/controllers/client/bin/python benchmarks/controllers/check.py --server build/controllers/server/bin/python $(ARGS)

soak: .venv/complete
	PYTHONPATH=tests $(BIN)/python -m soak --commands $(COMMANDS) --ticks $(TICKS) --calls $(CALLS) --files $(FILES) --processes $(PROCESSES) --kills $(KILLS) --run-kills $(RUN_KILLS) --run-signals $(RUN_SIGNALS) --study-kills $(STUDY_KILLS) --swings $(SWINGS) --seed $(SEED)

clean:
	rm -rf .venv build
