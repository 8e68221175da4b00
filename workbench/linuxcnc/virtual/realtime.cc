// SPDX-License-Identifier: GPL-2.0-or-later
// RTAPI for one process: memory visible only to it, messages, the virtual clock.

#include "virtual.h"

#include <errno.h>
#include <stdarg.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>

namespace {
struct Memory {
    void *at;
    size_t size;
};

std::map<int, Memory> &shared() {
    static std::map<int, Memory> memory;
    return memory;
}

using msg_level_t = int;
using rtapi_msg_handler_t = void (*)(msg_level_t, const char *, va_list);
rtapi_msg_handler_t handler = nullptr;
int level = RTAPI_MSG_ERR;

// The process that started the run keeps standard error, to report it on a failure.
void print(msg_level_t of, const char *format, va_list arguments) {
    if (of <= level) {
        std::vfprintf(stderr, format, arguments);
    }
}
}

namespace memory {
void *only(size_t &size) {
    if (shared().size() != 1) {
        return nullptr;
    }
    size = shared().begin()->second.size;
    return shared().begin()->second.at;
}
}

REPLACES int rtapi_init(const char *) {
    static int last = 0;
    return ++last;
}
REPLACES int rtapi_exit(int) { return 0; }
REPLACES int rtapi_shmem_new(int key, int, unsigned long size) {
    Memory &memory = shared()[key];
    if (!memory.at) {
        memory = {std::calloc(1, size), size};
    }
    return memory.at ? key : -ENOMEM;
}
REPLACES int rtapi_shmem_getptr(int handle, void **memory) {
    const auto found = shared().find(handle);
    if (found == shared().end()) {
        return -EINVAL;
    }
    *memory = found->second.at;
    return 0;
}
REPLACES int rtapi_shmem_delete(int, int) { return 0; }

REPLACES long long rtapi_get_time(void) { return clock_::now(); }
REPLACES long long rtapi_get_clocks(void) { return clock_::now(); }
REPLACES void rtapi_delay(long) {}
REPLACES long rtapi_delay_max(void) { return 10'000; }

REPLACES void rtapi_set_msg_handler(rtapi_msg_handler_t wanted) { handler = wanted; }
REPLACES rtapi_msg_handler_t rtapi_get_msg_handler(void) { return handler ? handler : print; }
REPLACES int rtapi_set_msg_level(int wanted) {
    level = wanted;
    return 0;
}
REPLACES int rtapi_get_msg_level(void) { return level; }
// LinuxCNC 2.9 computes NaN for an arc whose rotary axes move by rounding alone, such as the first one after homing,
// and then reports this in every cycle.
static const char *const NO_NUMBER = "invalid pose in tpAddCurrentPos";

REPLACES void rtapi_print_msg(msg_level_t of, const char *format, ...) {
    if (std::strstr(format, NO_NUMBER)) {
        give_up("LinuxCNC never gets through this arc, in which rotary axes move by less than rounding: go to its start by a "
                "G1 with all axes first, as from G53 G0 beside it");
    }
    va_list arguments;
    va_start(arguments, format);
    (handler ? handler : print)(of, format, arguments);
    va_end(arguments);
}
REPLACES void rtapi_print(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (handler ? handler : print)(RTAPI_MSG_ALL, format, arguments);
    va_end(arguments);
}
REPLACES int rtapi_snprintf(char *text, unsigned long size, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    const int length = std::vsnprintf(text, size, format, arguments);
    va_end(arguments);
    return length;
}
REPLACES int rtapi_vsnprintf(char *text, unsigned long size, const char *format, va_list arguments) {
    return std::vsnprintf(text, size, format, arguments);
}
