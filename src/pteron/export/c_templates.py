"""The fixed parts of the C code that is exported."""

from __future__ import annotations

__all__ = ["CHECK", "CMAKE", "HEADER", "HELPERS", "TEST"]

HELPERS: dict[str, str] = {
    "root": """\
/* The square root; NaN below zero, without a trap. */
static {real} {p}_root({real} value)
{{
    return isgreaterequal(value, {zero}) ? sqrt{f}(value) : ({real})NAN;
}}
""",
    "ratio": """\
/* The quotient; NaN where the divisor vanishes, without a trap. */
static {real} {p}_ratio({real} dividend, {real} divisor)
{{
    return isgreaterequal(fabs{f}(divisor), {least}) ? (dividend / divisor) : ({real})NAN;
}}
""",
    "finite": """\
/* Whether a number is neither infinite nor NaN. */
static int {p}_finite({real} value)
{{
    return islessequal(fabs{f}(value), {largest}) ? 1 : 0;
}}
""",
}

HEADER = """\
{banner}#ifndef {guard}
#define {guard}

#ifdef __cplusplus
#define {upper}_RESTRICT
extern "C" {{
#else
#define {upper}_RESTRICT restrict
#endif

/* What every function returns; the outputs are defined in each case, NaN where not computable. */
#define {upper}_OK 0
#define {upper}_UNREACHABLE 1 /* a leg's links or the closures do not meet, or the pose is NaN */
#define {upper}_NOT_FINITE 2  /* singular, or another input is not finite */

{tables}{functions}
#ifdef __cplusplus
}}
#endif

#endif
"""

CHECK = """\
static int check(const char *name, const {real} *found, const {real} *expected, int count)
{{
    {real} size = {zero}, error = {zero};
    for (int k = 0; k < count; k++) {{
        const {real} difference = fabs{f}(found[k] - expected[k]);
        size = fmax{f}(size, fabs{f}(expected[k]));
        error = (difference <= error) ? error : difference;
    }}
    if (!(error <= {tolerance} * size)) {{
        printf("%s: off by %g of %g\\n", name, (double)error, (double)size);
        return 1;
    }}
    return 0;
}}

"""

TEST = """\
{banner}#include "{name}.h"

#include <math.h>
#include <stdio.h>

{arrays}
static int check_status(const char *name, int status, int expected)
{{
    if (status != expected) {{
        printf("%s: status %d, expected %d\\n", name, status, expected);
        return 1;
    }}
    return 0;
}}

{checks}int main(void)
{{
    int failed = 0;
{calls}    printf("%s\\n", (failed == 0) ? "all functions agree with the library" : "FAILED");
    return (failed == 0) ? 0 : 1;
}}
"""

CMAKE = """\
cmake_minimum_required(VERSION 3.16)
project({name} LANGUAGES C)

set(CMAKE_C_STANDARD 99)
set(CMAKE_C_STANDARD_REQUIRED ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

add_library({name} STATIC {name}.c)
target_include_directories({name} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
target_link_libraries({name} PUBLIC m)
# gcc pairs neighbouring scalars into vectors here and waits for them: 15 % slower.
include(CheckCCompilerFlag)
check_c_compiler_flag(-fno-tree-slp-vectorize HAS_NO_SLP)
if(HAS_NO_SLP)
  target_compile_options({name} PRIVATE -fno-tree-slp-vectorize)
endif()

enable_testing()
add_executable(test_{name} test_{name}.c)
target_link_libraries(test_{name} PRIVATE {name})
add_test(NAME {name} COMMAND test_{name})
"""
