# cortex-m.cmake - CMake toolchain file: Debian's gcc-arm-none-eabi for one Cortex-M, nothing but the compiler (no newlib, no vendor's files).
#   cmake -S hal/template -B build/m3 --toolchain cortex-m.cmake -DHEAVE_CPU=cortex-m3
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(HEAVE_CPU cortex-m3 CACHE STRING "as gcc's -mcpu names it")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES HEAVE_CPU)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_C_FLAGS_INIT "-mcpu=${HEAVE_CPU} -mthumb -mfloat-abi=soft")
