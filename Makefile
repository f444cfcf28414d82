# SPDX-License-Identifier: MIT
# Thin calls to the scripts and presets; `make help` lists them.
JOBS ?= $(shell nproc)

.PHONY: help setup build arm64 release lab demo test test-all test-long bench format check-format lint docs clean

help:
	@echo "make demo          install what is missing, build, render a drive, run on it, show the numbers"
	@echo "make build         install what is missing, build the program build/release/stemvo"
	@echo "make lab           install what is missing, build the studies' program build/lab/bin/stemvo-lab (docs/search.md, robustness.md, benchmark.md)"
	@echo "make arm64         cross-compile for 64-bit ARM: build/arm64/stemvo and its Debian package"
	@echo "make release       wheels and Debian packages for x86_64 and 64-bit ARM, with their SHA-256: build/dist"
	@echo "make test          install what is missing, build, run the tests"
	@echo "make test-all      the same, and the tests that take long"
	@echo "make bench         time the program against its baselines, SEQUENCE=KITTI/sequences/NN or a rendered drive (docs/performance.md)"
	@echo "make format        rewrite the C++ sources in the project's format"
	@echo "make check-format  fail where a source is not in that format or names no licence"
	@echo "make docs          the documentation as a site: build/docs/index.html"
	@echo "make lint          run clang-tidy over the library and the program"
	@echo "make clean         remove what was built (build/venv* and ONNX Runtime stay)"

setup:
	@tools/setup.sh

build: setup
	@echo "==> Building build/release/stemvo"
	@# A checkout that was moved or copied holds another one's configuration.
	@cache=build/release/CMakeCache.txt; test ! -e $$cache || test "$$(sed -n 's/^CMAKE_HOME_DIRECTORY:INTERNAL=//p' $$cache)" -ef . || rm -rf $$cache build/release/CMakeFiles
	@cmake --preset release --log-level=WARNING >build/setup/configure.log || { cat build/setup/configure.log; exit 1; }
	@cmake --build --preset release --parallel $(JOBS) --target stemvo_app

arm64: build
	@tools/arm64.sh

release: build
	@tools/release.sh

lab: setup
	@tools/setup.sh lab

demo: build
	@tools/demo.sh

test: build lab
	@tools/setup.sh tools
	@tools/setup.sh tex || echo "==> Without tex"
	@echo "==> Building the tests"
	@cmake --build --preset release --parallel $(JOBS)
	@echo "==> Running the tests"
	@ctest --preset release --parallel $(JOBS); failed=$$?; tools/skipped.sh; exit $$failed

test-all: test test-long

# Without one of these groups the tests that need it are skipped.
test-long: lab
	@for group in peers browser root tex; do tools/setup.sh $$group || echo "==> Without $$group"; done
	@tools/setup.sh docs
	@echo "==> Running the long tests"
	@ctest --preset long --parallel $(JOBS); failed=$$?; tools/skipped.sh; exit $$failed

SEQUENCE ?=
BENCH ?=
bench: build
	@tools/setup.sh lab peers
	@bench/run.py $(SEQUENCE) $(BENCH)

format:
	@tools/setup.sh tools
	@tools/format.sh

check-format:
	@tools/setup.sh tools
	@tools/format.sh --check

docs: setup
	@tools/docs.sh

lint: setup
	@tools/setup.sh lint
	@tools/lint.sh

clean:
	@rm -rf build/release build/dev build/asan build/tsan build/fuzz build/coverage build/bench-run build/tidy build/demo
