# unity.cmake - the library target `unity`, and how tests are declared: heave_unit_test, heave_script_test, heave_kernel_test, heave_clock.
# Unity is not part of this tree: tools/lib/unity.sh finds or fetches it, unless UNITY_DIR says where it is.
set(UNITY_DIR "" CACHE PATH "Folder that holds unity.c and unity.h; empty: found or fetched by tools/lib/unity.sh")
if(NOT EXISTS "${UNITY_DIR}/unity.c")
  execute_process(COMMAND ${PROJECT_SOURCE_DIR}/tools/lib/unity.sh OUTPUT_VARIABLE found OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "Unity not found, the reason stands above")
  endif()
  set_property(CACHE UNITY_DIR PROPERTY VALUE "${found}")
endif()
add_library(unity STATIC ${UNITY_DIR}/unity.c)
target_include_directories(unity SYSTEM PUBLIC ${UNITY_DIR})
target_compile_definitions(unity PUBLIC UNITY_INCLUDE_DOUBLE= UNITY_SUPPORT_64 UNITY_DOUBLE_PRECISION=1e-12)

find_package(Python3 REQUIRED COMPONENTS Interpreter)
# Itself, where that is a script which looks for it first, each time anew (pyenv).
execute_process(COMMAND ${Python3_EXECUTABLE} -c "import sys; print(sys.executable)" OUTPUT_VARIABLE Python3_EXECUTABLE OUTPUT_STRIP_TRAILING_WHITESPACE
                COMMAND_ERROR_IS_FATAL ANY)

# Tests are run side by side by weight (PROCESSORS): HEAVE_COMPUTES takes a processor as long as it runs, HEAVE_WAITS mostly waits for real time
# to pass, HEAVE_YIELDS takes what is left: it computes at a lower priority, on virtual time. tools/lib/run_tests.py hands out three for each
# processor, and two more, so that those that wait run beside those that compute, and no processor is ever idle.
set(HEAVE_COMPUTES 3)
set(HEAVE_YIELDS 2)
set(HEAVE_WAITS 1)

# Long ones begin first, so that none is left for the end: seconds, measured on two processors. Before them what waits for real time, beside which others
# compute.
set(HEAVE_SECONDS
  system.panel_pages 900 system.panel_hands 890 system.panel_configuration 880 system.panel_commission 870 # one browser, one after the other
  system.flood 800 system.syscalls 800 system.metrics 790 system.modbus_drives 780 python.recipes 770 system.kernel 760 system.modbus_line 750
  system.panel 100 golden.armhf 73 property.senders.engaged 72 golden.arm64 67 golden.optimisation 62 system.modbus_presets 59 system.setup.killed 56
  golden.cortex 51 property.senders.streams 50 check.package 50 system.setup.Modbus 40 system.selftest 36 check.judge 36 property.senders.ramps 36
  property.singularity 36 system.twin.alone 34 system.twin.not_enabled 33 system.setup.together 32 system.service_mode 31 system.live 31
  system.twin.configured 29 system.setup.home 29 system.can.failures.named 27 system.setup.Chinese 27 check.trace 26 system.twin.of_drives 26
  property.hostile 26 system.setup_vcan 25 system.can.failures.together 24 system.can.failures.latched 24 system.coils 22 system.timed_streams 22
  system.senders 21 system.twin_modbus.rtu 21 system.canraw 21 system.angle 21 check.plot_bench 21 system.can.CSP 20 check.lint 20
  property.senders.shakes 19 property.limits.tripod-rotation 19 system.twin_modbus.tcp 18 system.beside 18 system.twin_slcan 17 system.doctor 16
  system.can.Mbit 16 golden.s390x 16)

# The place of a test in the order.
function(heave_order name)
  list(FIND HEAVE_SECONDS ${name} place)
  if(place GREATER -1)
    math(EXPR place "${place} + 1")
    list(GET HEAVE_SECONDS ${place} seconds)
    set_tests_properties(${name} PROPERTIES COST ${seconds})
  endif()
endfunction()

# heave_unit_test(NAME [SOURCE...]): one executable per module, tests/unit/test_NAME.c, linked with the core.
function(heave_unit_test name)
  add_executable(test_${name} test_${name}.c ${PROJECT_SOURCE_DIR}/tests/support/unity_assert.c ${ARGN})
  target_link_libraries(test_${name} PRIVATE heave_core unity m)
  target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support)
  target_compile_definitions(test_${name} PRIVATE HEAVE_TEST_DATA="${PROJECT_SOURCE_DIR}/tests/data")
  # on the file, because a target's own options stand before those of heave_options and would lose
  set_source_files_properties(test_${name}.c PROPERTIES COMPILE_OPTIONS "-Wno-conversion;-Wno-sign-conversion")
  add_test(NAME unit.${name} COMMAND test_${name})
  set_tests_properties(unit.${name} PROPERTIES PROCESSORS ${HEAVE_COMPUTES})
  heave_order(unit.${name})
endfunction()

# heave_script_test(NAME SCRIPT [ARG...]): a Python script that reports its cases in TAP (tests/lib/tap.py, importable as `tap`).
function(heave_script_test name script)
  add_test(NAME ${name} COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/${script} ${ARGN})
  set_tests_properties(${name} PROPERTIES ENVIRONMENT "PYTHONPATH=${PROJECT_SOURCE_DIR}/tests/lib:${PROJECT_SOURCE_DIR}/python;PYTHONDONTWRITEBYTECODE=1" PROCESSORS
                                               ${HEAVE_COMPUTES})
  heave_order(${name})
endfunction()

# heave_kernel_test(NAME [VIRTUAL_TIME] [PYTHON] COMMAND [ARG...]): a program, Unity or TAP, on a kernel that has CAN; see tests/lib/kernel.py.
function(heave_kernel_test name)
  cmake_parse_arguments(PARSE_ARGV 1 kernel "VIRTUAL_TIME;PYTHON" "" "")
  set(options --limit 1700) # says that it never ends, not that it was slow
  set(weight ${HEAVE_COMPUTES})
  if(kernel_VIRTUAL_TIME)
    list(APPEND options --virtual-time)
    set(weight ${HEAVE_YIELDS})
  endif()
  if(kernel_PYTHON)
    list(APPEND options --python)
  endif()
  if(HEAVE_SANITIZE)
    list(APPEND options --instrumented)
  endif()
  add_test(NAME ${name} COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/lib/kernel.py ${options} -- ${kernel_UNPARSED_ARGUMENTS})
  set_tests_properties(${name} PROPERTIES ENVIRONMENT "PYTHONPATH=${PROJECT_SOURCE_DIR}/tests/lib:${PROJECT_SOURCE_DIR}/python;PYTHONDONTWRITEBYTECODE=1" LABELS kernel TIMEOUT 1800
                                               PROCESSORS ${weight})
  heave_order(${name})
endfunction()

# heave_exact_test(NAME [PYTHON] SCRIPT [ARG...]): a script that runs programs live, on virtual time. With sanitizers there is none: then a clock test.
function(heave_exact_test name)
  cmake_parse_arguments(PARSE_ARGV 1 exact "PYTHON" "" "")
  list(POP_FRONT exact_UNPARSED_ARGUMENTS script)
  if(HEAVE_SANITIZE)
    heave_script_test(${name} ${script} ${exact_UNPARSED_ARGUMENTS})
    set_tests_properties(${name} PROPERTIES LABELS system TIMEOUT 1800)
    set_property(TEST ${name} APPEND PROPERTY LABELS clock) # programs with sanitizers do not run on virtual time
  elseif(exact_PYTHON)
    heave_kernel_test(${name} VIRTUAL_TIME PYTHON ${CMAKE_CURRENT_SOURCE_DIR}/${script} ${exact_UNPARSED_ARGUMENTS})
  else()
    heave_kernel_test(${name} VIRTUAL_TIME ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/${script} ${exact_UNPARSED_ARGUMENTS})
  endif()
endfunction()

# heave_clock(SENTENCE NAME...): these tests of this folder need real time, and the sentence says what for. A busy machine can make such a test fail, so that
# tools/lib/run_tests.py tries it again, alone. Every other test is exact: the same on any machine, beside any load, and never tried again.
function(heave_clock sentence)
  foreach(name ${ARGN})
    if(NOT TEST ${name}) # not in this build
      continue()
    endif()
    set_property(TEST ${name} APPEND PROPERTY LABELS clock)
    set_property(GLOBAL APPEND_STRING PROPERTY HEAVE_CLOCK_TESTS "${name}\t${sentence}\n")
  endforeach()
endfunction()
