# firmware.cmake - how firmware is built: options, the core as heave_core, and heave_link, which every program links.
get_filename_component(TOP ${CMAKE_CURRENT_LIST_DIR}/../.. ABSOLUTE)

set(CMAKE_C_STANDARD 99)
set(CMAKE_C_STANDARD_REQUIRED ON)
set(CMAKE_C_EXTENSIONS OFF)
# Without newlib a freestanding compiler has no string.h; libc/ declares and defines the four functions that gcc calls by itself.
# Enumerations as wide as int: as on a PC, so that plain data can come from one.
execute_process(COMMAND ${CMAKE_C_COMPILER} -print-file-name=include OUTPUT_VARIABLE GCC_INCLUDE OUTPUT_STRIP_TRAILING_WHITESPACE)
add_compile_options(-Os -g -ffreestanding -ffunction-sections -fdata-sections -fno-short-enums -fmacro-prefix-map=${TOP}/=
  -nostdinc "SHELL:-isystem ${CMAKE_CURRENT_LIST_DIR}/libc" "SHELL:-isystem ${GCC_INCLUDE}")
# What else makes it smaller than -Os alone, with gcc 12 by 1.4 %: functions apart keep their frames apart too, and moving code about costs registers.
add_compile_options(-fno-inline-functions-called-once -fno-move-loop-invariants -fno-schedule-insns2)
add_compile_options(-fstack-usage -fcallgraph-info=su) # .ci files, from which tests/cortex/stack_bound.py bounds the stack

add_subdirectory(${TOP}/src ${CMAKE_BINARY_DIR}/core)

# Start-up and memory functions, the same for every program.
add_library(heave_start OBJECT ${CMAKE_CURRENT_LIST_DIR}/start.c ${CMAKE_CURRENT_LIST_DIR}/libc.c)
set_source_files_properties(${CMAKE_CURRENT_LIST_DIR}/libc.c PROPERTIES COMPILE_OPTIONS -fno-tree-loop-distribute-patterns) # or memset would call itself
target_link_libraries(heave_start PUBLIC heave_options)
target_include_directories(heave_start PUBLIC ${CMAKE_CURRENT_LIST_DIR})
add_library(heave_link INTERFACE)
target_link_libraries(heave_link INTERFACE heave_start $<TARGET_OBJECTS:heave_start> heave_core gcc)
target_link_options(heave_link INTERFACE -nostdlib -nostartfiles -Wl,--gc-sections -Wl,--no-warn-mismatch -L${CMAKE_CURRENT_LIST_DIR}
  -T ${CMAKE_CURRENT_LIST_DIR}/cortex-m.ld)

