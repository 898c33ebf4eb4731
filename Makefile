# `make demo` and `make test` set up what they need in .venv; only Python 3.11+ and make are expected.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

QUICK := published kinematics delta family manipulator errors toml passes payload costs

.PHONY: demo quick test lint bench clean

demo: $(VENV)/.runtime
	$(BIN)/pteron report quadrupteron --out demo
	$(BIN)/pteron table1

# One thread of linear algebra a process: the tests share the cores among themselves.
test: lint
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses auto

# Under a minute on two cores: the numbers, the files and the messages, for the edit loop.
quick: $(VENV)/.dev
	$(BIN)/ruff check
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses auto --quiet $(QUICK:%=tests/test_%.py)

lint: $(VENV)/.dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.dev
	$(BIN)/python benchmarks

$(VENV)/.runtime: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) install --editable '.[consistency]'
	touch $@

$(VENV)/.dev: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) install --editable '.[dev]'
	touch $@ $(VENV)/.runtime

clean:
	rm -rf $(VENV) demo dist build
