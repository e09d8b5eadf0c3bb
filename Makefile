# Front door.  The build itself is CMake's (CMakeLists.txt, CMakePresets.json).
#
#   make demo       everything on photographs that the program makes itself; opens as demo/report/index.html
#   make test       every test; those that need real data say so when they are skipped
#   make test-long  the tests that take long, too
#   make bench      speed beside error
#   make install    PREFIX=/usr/local, DESTDIR=
#
# Each first installs what is missing (make deps).  SKIP_DEPS=1 leaves that out.

PRESET ?= release
BUILD := build/$(PRESET)
DEMO ?= demo
JOBS ?= $(shell nproc)
TEST_JOBS ?= $(shell nproc | awk '{print $$1 < 2 ? 1 : ($$1 > 4 ? 4 : $$1)}')

export SKIP_DEPS

.PHONY: all deps configure build demo test test-long bench install clean
.NOTPARALLEL:

all: build

deps:
	@sh deps/install.sh

configure: deps
	@cmake --preset $(PRESET) $(if $(PREFIX),-DCMAKE_INSTALL_PREFIX=$(PREFIX)) $(CMAKE_ARGUMENTS)

build: configure
	@cmake --build $(BUILD) -j $(JOBS)

demo: build
	$(BUILD)/app/tsuya demo $(DEMO)

test: build
	@sh tests/run.sh $(BUILD) $(TEST_JOBS) "" "long|bench"

test-long: build
	@sh tests/run.sh $(BUILD) $(TEST_JOBS) "" "bench"

bench: build
	@sh tests/run.sh $(BUILD) 1 "bench" ""

install: build
	cmake --install $(BUILD)

clean:
	rm -rf build
