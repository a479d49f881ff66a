# unity.cmake - the library target `unity`, and how tests are declared: heave_unit_test, heave_script_test, heave_kernel_test.
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

# Tests are run side by side by weight (PROCESSORS): HEAVE_COMPUTES takes a processor as long as it runs, HEAVE_WAITS half of one, because it
# mostly waits for real time to pass. tools/lib/run_tests.py hands out two for each processor.
set(HEAVE_COMPUTES 2)
set(HEAVE_WAITS 1)

# heave_unit_test(NAME [SOURCE...]): one executable per module, tests/unit/test_NAME.c, linked with the core.
function(heave_unit_test name)
  add_executable(test_${name} test_${name}.c ${ARGN})
  target_link_libraries(test_${name} PRIVATE heave_core unity m)
  target_compile_definitions(test_${name} PRIVATE HEAVE_TEST_DATA="${PROJECT_SOURCE_DIR}/tests/data")
  # on the file, because a target's own options stand before those of heave_options and would lose
  set_source_files_properties(test_${name}.c PROPERTIES COMPILE_OPTIONS "-Wno-conversion;-Wno-sign-conversion")
  add_test(NAME unit.${name} COMMAND test_${name})
  set_tests_properties(unit.${name} PROPERTIES PROCESSORS ${HEAVE_COMPUTES})
endfunction()

# heave_script_test(NAME SCRIPT [ARG...]): a Python script that reports its cases in TAP (tests/lib/tap.py, importable as `tap`).
function(heave_script_test name script)
  add_test(NAME ${name} COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/${script} ${ARGN})
  set_tests_properties(${name} PROPERTIES ENVIRONMENT "PYTHONPATH=${PROJECT_SOURCE_DIR}/tests/lib;PYTHONDONTWRITEBYTECODE=1" PROCESSORS
                                               ${HEAVE_COMPUTES})
endfunction()

# heave_kernel_test(NAME [VIRTUAL_TIME] [PYTHON] COMMAND [ARG...]): a program, Unity or TAP, on a kernel that has CAN; see tests/lib/kernel.py.
function(heave_kernel_test name)
  cmake_parse_arguments(PARSE_ARGV 1 kernel "VIRTUAL_TIME;PYTHON" "" "")
  set(options --limit 860)
  if(kernel_VIRTUAL_TIME)
    list(APPEND options --virtual-time)
  endif()
  if(kernel_PYTHON)
    list(APPEND options --python)
  endif()
  if(HEAVE_SANITIZE)
    list(APPEND options --instrumented)
  endif()
  add_test(NAME ${name} COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/lib/kernel.py ${options} -- ${kernel_UNPARSED_ARGUMENTS})
  set_tests_properties(${name} PROPERTIES ENVIRONMENT "PYTHONPATH=${PROJECT_SOURCE_DIR}/tests/lib;PYTHONDONTWRITEBYTECODE=1" LABELS kernel TIMEOUT 900
                                               PROCESSORS ${HEAVE_COMPUTES})
endfunction()
