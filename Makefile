# `make demo`, `make test` and `make docs` set up what they need in .venv; only Python 3.11+ and make are expected.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
UV := $(BIN)/python -m uv pip --quiet

QUICK := published delta family conformance manipulator errors toml passes costs

# One thread of linear algebra a process, and a file's tests in one process: they share what is made.
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses auto --dist loadfile

# Each program that a test starts would translate the sources anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo quick test tests clients nightly lint bench docs evidence first wheels clean

demo: $(VENV)/.runtime
	$(BIN)/pteron report delta --out demo
	@echo "Open demo/report.html in a browser. To drag the robot: $(BIN)/pteron view delta"

# The gate: lint and tests side by side, some six minutes on two cores; tests/README.md says what waits
# for `make nightly`.
test: $(VENV)/.dev
	+$(MAKE) --no-print-directory --jobs 2 lint tests

tests: $(VENV)/.dev
	$(PYTEST)

# Under a minute on two cores: the numbers, the files and the messages, for the edit loop.
quick: $(VENV)/.dev
	$(BIN)/ruff check
	$(PYTEST) --quiet $(QUICK:%=tests/test_%.py)

# What uses the library as others do: benchmarks, examples, notebooks, browsers, other programs.
clients: $(VENV)/.dev
	$(PYTEST) --dist worksteal -m "clients and not nightly"

# Every test there is, on every machine.
nightly: $(VENV)/.dev
	$(PYTEST) -m ""

lint: $(VENV)/.dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy --num-workers 2
	$(BIN)/lint-imports

bench: $(VENV)/.dev
	$(BIN)/python benchmarks

# The site, docs/_build/html: a warning is an error, and then every link of it is followed. Pictures,
# notebooks and examples are made anew where code, scripts or packages have changed since the last build.
docs: $(VENV)/.docs
	OPENBLAS_NUM_THREADS=1 $(BIN)/python docs/build.py

# Runs what stands behind the figures of README and docs, and says what differs; about half an hour.
# `$(BIN)/python benchmarks/evidence.py --all` takes hours.
evidence: $(VENV)/.dev
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/evidence.py

# The commands of README and the tour in a fresh copy of this clone, after README's set-up; some minutes.
first:
	$(PYTHON) tests/installed/readme.py

# The wheel in empty environments: every Python here, each extra alone, all, and all at their lowest
# versions; over half an hour.
wheels:
	$(PYTHON) tests/installed/matrix.py

# A small part of pip's time; pip where uv cannot. Sources are translated when they are first imported: all
# of them would take a minute.
define install
test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
$(PIP) install uv && $(UV) install --python $(BIN)/python --editable '.[$(EXTRAS)]' \
	|| $(PIP) install --editable '.[$(EXTRAS)]'
endef
$(VENV)/.runtime: EXTRAS := consistency,design,film,viewer
$(VENV)/.dev: EXTRAS := dev
$(VENV)/.docs: EXTRAS := docs

# What README and the tour show runs in this one: `make first` tries it.
$(VENV)/.runtime: pyproject.toml Makefile
	$(install)
	touch $@

$(VENV)/.dev: pyproject.toml
	$(install)
	touch $@ $(VENV)/.runtime

$(VENV)/.docs: pyproject.toml
	$(install)
	touch $@ $(VENV)/.runtime

clean:
	rm -rf $(VENV) demo dist build docs/_build docs/gallery docs/measured
	rm -rf docs/reference/commands docs/reference/functions docs/reference/inside docs/reference/modules
