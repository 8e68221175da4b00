// SPDX-License-Identifier: GPL-2.0-or-later
// A substitute for every function of LinuxCNC's own HAL library that has none here: whoever calls it ends
// the run. The list is made from that library when this one is built; those that are defined here win.

#include <cstdio>
#include <cstdlib>

[[noreturn]] void give_up(const char *format, ...) __attribute__((format(printf, 1, 2)));

#define UNCOVERED(NAME)                                                                  \
    extern "C" __attribute__((weak, visibility("default"))) void NAME() {                \
        give_up("LinuxCNC calls %s, which has no substitute in virtual time", #NAME);    \
    }
#include "uncovered.inc"
