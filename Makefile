# SwarmTouch needs Python >= 3.11, make and a package registry. Everything else is brought along into .bootstrap/
# and .venv/; nothing outside this folder changes.

export UV_PYTHON_DOWNLOADS := never
export UV_PYTHON_PREFERENCE := only-system

UV := .bootstrap/uv
BIN := .venv/bin
RUNTIME := .venv/.runtime
DEVELOPMENT := .venv/.development
# mypyc in an environment of its own: setuptools, which it needs, would slow every start of a Python in .venv.
COMPILER := .bootstrap/compiler
COMPILE := UV_PROJECT_ENVIRONMENT=$(COMPILER) $(UV) sync --frozen --quiet --no-dev --group compile \
	--no-install-project --python $(BIN)/python && $(COMPILER)/bin/python -m deploy.compile
WHERE_POSSIBLE := if $(BIN)/python -m deploy.compile.toolchain; then $(COMPILE) || echo "flying in the pure form"; fi

.PHONY: help demo env native compile test check lint chip chaos wheels clean

help:  ## list what can be made
	@sed -n 's/^\([a-z]*\):.*  ## /\1\t/p' Makefile | expand -t 8

demo: $(RUNTIME)  ## fly the paper's rhombus for 30 s, simulated, or for longer by hand in the browser
	@$(WHERE_POSSIBLE)
	$(BIN)/swarmtouch up slalom --console --hand "scripted:tour?duration=26" --glove terminal://

env: native  ## set up everything that developing needs in .venv/

native: $(DEVELOPMENT)
	@$(WHERE_POSSIBLE)

compile: $(RUNTIME)  ## compile the control law to native code; demo, env and test do it where there is a C compiler
	@$(BIN)/python -m deploy.compile.toolchain && $(COMPILE)

# What measures flights of real processes wants the machine to itself; everything else shares it. What a busy machine
# spoils is flown again, twice at most and by name in the output: a defect spoils every flight, noise one.
# The pure form skips the long flights: tests/unit/test_forms.py shows that both forms fly them to the same bits.
test:  ## everything CI runs: format, lint, types, import contracts, all tests
	@$(MAKE) --jobs=2 --output-sync=target lint native
	$(BIN)/pytest --numprocesses auto tests/unit tests/contract tests/replay
	SWARMTOUCH_PURE=1 $(BIN)/pytest --numprocesses auto -m "law and not slow" tests/unit tests/contract tests/replay
	$(BIN)/pytest --numprocesses 2 --reruns 2 -raR -m parallel tests/integration
	$(BIN)/pytest --reruns 2 -raR -m "not parallel" tests/integration

check: lint  ## the quick gate: format, lint, types, import contracts, unit tests
	$(BIN)/pytest --numprocesses auto -m "not slow" tests/unit

lint: $(DEVELOPMENT)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Debian: gcc libc6-dev gcc-avr avr-libc arduino-core-avr libsimavr-dev libelf-dev clang libclang-rt-14-dev
chip:  ## the glove's firmware, its fuzzer, and a simulated chip that runs it; then pytest tests/chip
	$(MAKE) -C glove_bridge/firmware BUILD=$(CURDIR)/build/firmware
	$(MAKE) -C tests/chip/harness BUILD=$(CURDIR)/build/chip
	$(MAKE) -C tests/chip/fuzz BUILD=$(CURDIR)/build/fuzz

chaos: $(DEVELOPMENT)  ## as root: kill, freeze, part and flood a swarm in network namespaces; one table
	$(BIN)/python -m tests.chaos --csv runs/chaos.csv

wheels: | $(UV)  ## into dist/: a wheel for every Python and, with a C compiler, a compiled one for this Python here
	$(UV) build --wheel

clean:  ## remove what was set up and cached; flights in runs/ stay
	rm -rf .bootstrap .venv build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# --inexact: flying never removes the tools of an environment for development. Pure: a checkout is compiled by
# `compile`, whose tools its installation then does not need.
$(RUNTIME): pyproject.toml uv.lock | $(UV)
	SWARMTOUCH_PURE=1 $(UV) sync --frozen --no-dev --inexact
	@touch $@

$(DEVELOPMENT): pyproject.toml uv.lock | $(UV)
	SWARMTOUCH_PURE=1 $(UV) sync --frozen
	@touch $@ $(RUNTIME)

$(UV):
	sh deploy/bootstrap.sh $@
