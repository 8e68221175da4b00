// SPDX-License-Identifier: GPL-2.0-or-later
// A substitute for every function of LinuxCNC's HAL library that is not implemented here: a call to it ends
// the run. Functions defined here take precedence.

#include <cstdio>
#include <cstdlib>

[[noreturn]] void give_up(const char *format, ...) __attribute__((format(printf, 1, 2)));

#define UNCOVERED(NAME)                                                                  \
    extern "C" __attribute__((weak, visibility("default"))) void NAME() {                \
        give_up("LinuxCNC calls %s, which has no substitute in virtual time", #NAME);    \
    }
#include "uncovered.inc"
