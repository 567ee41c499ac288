# `make demo` and `make test` do all the set-up themselves, on a Debian 12 with root and nothing but make.
# What is done is marked by files in .setup/; a second run does only what has changed.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip install --quiet --disable-pip-version-check
# Packages of others: byte code is written on all cores afterwards, where pip writes it on one (what cannot be compiled
# is no module of this Python).
PACKAGES = $(PIP) --no-compile
BYTE_CODE = $(BIN)/python -m compileall -qq -j $(CMAKE_BUILD_PARALLEL_LEVEL) $(VENV)/lib || true
BUILD := build/make
SANITIZE := build/sanitize
OUT ?= demo
export CMAKE_BUILD_PARALLEL_LEVEL ?= 2
# Tests of one file run in one process, so that what they share is made once; IN_PARALLEL= runs all in one.
IN_PARALLEL ?= -n $(CMAKE_BUILD_PARALLEL_LEVEL) --dist loadfile
SOURCES := CMakeLists.txt pyproject.toml $(shell find cpp python -type f ! -name '*.so' ! -name '*.pyc')
CPP_TESTS := $(shell find tests/cpp -type f 2>/dev/null)

# Not deleted as intermediate files.
.PRECIOUS: .setup/packages-%

.PHONY: fuzz fuzz-core sanitize-threads help demo test lint test-cpp test-python robustness sanitize limits install bench docs wheel clean

help:
	@echo "make demo     set up everything, run exactarm on the shipped data, say where the report lies"
	@echo "make test     set up everything, run the linter, the C++ and the Python tests"
	@echo "make lint     the linter and the types alone"
	@echo "make install  set up everything: $(BIN)/exactarm"
	@echo "make robustness  ten thousand spoiled inputs, and 200 kills of every command (SEED=N: from that seed on)"
	@echo "make sanitize C++ tests and one short run of every command under address and undefined-behaviour sanitizers"
	@echo "make sanitize-threads  the C++ tests under the thread sanitizer"
	@echo "make fuzz-core  coverage-guided fuzzing of the C++ core by clang, ten minutes each (SECONDS_EACH=N)"
	@echo "make fuzz     coverage-guided fuzzing of the readers, ten minutes each (SECONDS_EACH=N)"
	@echo "make limits   rows, seconds and memory of every command, as measured here"
	@echo "make bench    the C++ benchmarks"
	@echo "make docs     the documentation as a site: docs/_site/index.html"
	@echo "make wheel    wheels that run anywhere, in dist/, one for each Python in PYTHONS, each tested"
	@echo "make clean    remove what was built (the environment stays)"

demo: .setup/install
	@$(BIN)/exactarm demo --out $(OUT)

# The linter runs beside the compiler.
test: .setup/install .setup/packages-test
	@$(MAKE) --no-print-directory -j 2 lint .setup/tests
	@$(MAKE) --no-print-directory test-cpp test-python

# Rules of the linter, and types of what a user calls; pyproject.toml has both.
lint: .setup/install .setup/packages-test
	@echo "== ruff and mypy"
	@$(BIN)/ruff check --quiet --cache-dir build/ruff .
	@$(BIN)/mypy --cache-dir build/mypy

test-cpp: .setup/tests
	@echo "== C++ tests"
	@ctest --test-dir $(BUILD) --output-on-failure --no-tests=error -j $(CMAKE_BUILD_PARALLEL_LEVEL) > $(BUILD)/ctest.log \
	  || { tail -n 80 $(BUILD)/ctest.log; exit 1; }
	@tail -n 4 $(BUILD)/ctest.log

test-python: export OMP_NUM_THREADS := 1
test-python: export OPENBLAS_NUM_THREADS := 1
test-python: .setup/tests
	@echo "== Python tests"
	@$(BIN)/python -m pytest $(IN_PARALLEL)
	@$(BIN)/python -m pytest $(IN_PARALLEL) -m slow

# Spoiled inputs to every reader and command, and 200 kills of each command, for a night; seeds are told.
robustness: .setup/tests
	@$(BIN)/python tests/robustness/run.py --count 10000 --seed $(or $(SEED),0)
	@$(BIN)/python tests/robustness/kills.py --count 200 --seed $(or $(SEED),0)

# Addresses, bounds and undefined behaviour: the C++ tests and one short run of every command with sanitizers.
sanitize: .setup/tests
	@echo "== building with sanitizers (the first time takes minutes)"
	@mkdir -p $(SANITIZE)
	@cmake -S . -B $(SANITIZE) -DCMAKE_BUILD_TYPE=Release -DEXACTARM_SANITIZE=address,undefined -DEXACTARM_TESTS=ON \
	  -DEXACTARM_MODULE_FOLDER=$(CURDIR)/$(SANITIZE)/core -DPython_EXECUTABLE=$(CURDIR)/$(BIN)/python \
	  -Dpybind11_DIR=$$($(BIN)/python -m pybind11 --cmakedir) > $(SANITIZE)/configure.log
	@cmake --build $(SANITIZE) > $(SANITIZE)/build.log 2>&1 || { tail -n 40 $(SANITIZE)/build.log; exit 1; }
	@$(SANITIZE)/exactarm_tests --gtest_brief=1
	@$(BIN)/python tests/robustness/sanitized.py $(SANITIZE)

# Data races: the C++ tests, those of the planner's threads among them. Without the interpreter, which is not built so.
sanitize-threads: .setup/system
	@mkdir -p $(SANITIZE)-threads
	@cmake -S . -B $(SANITIZE)-threads -DCMAKE_BUILD_TYPE=Release -DEXACTARM_SANITIZE=thread -DEXACTARM_TESTS=ON \
	  -DEXACTARM_PYTHON=OFF > $(SANITIZE)-threads/configure.log
	@cmake --build $(SANITIZE)-threads > $(SANITIZE)-threads/build.log 2>&1 || { tail -n 40 $(SANITIZE)-threads/build.log; exit 1; }
	@$(SANITIZE)-threads/exactarm_tests --gtest_brief=1

# Coverage-guided fuzzing of the core (libFuzzer) with address and undefined-behaviour sanitizers; the corpus stays.
CORE_FUZZ := build/fuzz-core
fuzz-core: .setup/system .setup/fuzz
	@mkdir -p $(CORE_FUZZ)
	@cmake -S . -B $(CORE_FUZZ) -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=clang++-14 -DEXACTARM_FUZZ=ON \
	  -DEXACTARM_SANITIZE=address,undefined -DEXACTARM_PYTHON=OFF > $(CORE_FUZZ)/configure.log
	@cmake --build $(CORE_FUZZ) > $(CORE_FUZZ)/build.log 2>&1 || { tail -n 40 $(CORE_FUZZ)/build.log; exit 1; }
	@for fuzzer in robot_fuzz plan_fuzz; do mkdir -p $(CORE_FUZZ)/$$fuzzer-corpus; \
	  $(CORE_FUZZ)/$$fuzzer -max_total_time=$(or $(SECONDS_EACH),600) -timeout=20 -rss_limit_mb=2048 -max_len=4096 \
	    -artifact_prefix=$(CORE_FUZZ)/ $(CORE_FUZZ)/$$fuzzer-corpus || exit 1; done

# Coverage-guided fuzzing of the readers, SECONDS each; what was found is kept in build/fuzz for the next run.
fuzz: .setup/tests .setup/packages-fuzz
	@$(BIN)/python tests/robustness/coverage_guided.py --seconds $(or $(SECONDS_EACH),600)

# Rows, seconds and memory of every command, into the table of docs/limits.md.
limits: .setup/install
	@$(BIN)/python bench/limits.py --write docs/limits.md

install: .setup/install

bench: .setup/bench
	@cmake -S . -B build/bench -DEXACTARM_BENCH=ON -DEXACTARM_PYTHON=OFF -DCMAKE_BUILD_TYPE=Release > build/bench.log
	@cmake --build build/bench

docs: .setup/install .setup/packages-docs
	@$(BIN)/python -m sphinx -q -W --keep-going docs docs/_site
	@echo "docs/_site/index.html"

PYTHONS ?= $(BIN)/python
wheel: .setup/system
	@bash setup/wheel.sh $(PYTHONS)

# System packages, each stamp for what its users need.
.setup/system: setup/system.sh setup/packages.txt
	@mkdir -p .setup && bash setup/system.sh setup/packages.txt && touch $@

.setup/bench: setup/system.sh setup/packages-bench.txt .setup/system
	@bash setup/system.sh setup/packages-bench.txt && mkdir -p build && touch $@

.setup/fuzz: setup/system.sh setup/packages-fuzz.txt .setup/system
	@bash setup/system.sh setup/packages-fuzz.txt && touch $@

.setup/venv: setup/venv.sh .setup/system
	@bash setup/venv.sh $(VENV) && touch $@

# The build tools are in the environment, so that the build folder is used again from one run to the next.
.setup/packages-%: pyproject.toml setup/requirements.py .setup/venv
	@echo "== Python packages ($*)"
	@[ ! -f setup/lock/$*.txt ] || $(PACKAGES) --require-hashes -r setup/lock/$*.txt
	@$(BIN)/python setup/requirements.py $* > .setup/$*.txt
	@$(PACKAGES) -r .setup/$*.txt
	@$(BYTE_CODE)
	@touch $@

.setup/install: $(SOURCES) .setup/packages-build
	@echo "== building exactarm (the first time takes minutes)"
	@$(PACKAGES) --require-hashes -r setup/lock/run.txt
	@$(BYTE_CODE)
	@$(PIP) --no-build-isolation --config-settings=build-dir=$(BUILD) --config-settings=cmake.define.EXACTARM_CPU=native \
	  --config-settings=cmake.define.EXACTARM_WARNINGS_AS_ERRORS=ON . && touch $@

.setup/tests: $(CPP_TESTS) .setup/install .setup/packages-test
	@echo "== building the C++ tests"
	@cmake $(BUILD) -DEXACTARM_TESTS=ON > $(BUILD)/tests.log
	@cmake --build $(BUILD) --target exactarm_tests >> $(BUILD)/tests.log || { tail -n 40 $(BUILD)/tests.log; exit 1; }
	@touch $@

clean:
	rm -rf build .setup/install .setup/tests
