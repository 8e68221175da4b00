// SPDX-License-Identifier: GPL-2.0-or-later
// HAL for one process: pins, parameters, signals and functions, in memory of its own.

#include "virtual.h"

#include <errno.h>
#include <fnmatch.h>
#include <stdarg.h>
#include <strings.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <vector>

namespace {
struct Pin {
    hal_type_t type;
    bool is_output;
    // The pointer that the component reads and writes through.
    void **where;
};

struct Function {
    void (*call)(void *, long);
    void *argument;
};

std::map<std::string, Pin> &all() {
    static std::map<std::string, Pin> pins;
    return pins;
}

std::map<std::string, void *> &signals() {
    static std::map<std::string, void *> signals;
    return signals;
}

std::map<std::string, Function> &functions() {
    static std::map<std::string, Function> functions;
    return functions;
}

std::vector<Function> &in_thread() {
    static std::vector<Function> called;
    return called;
}

// HAL's values are volatile, for other processes; here there is one.
void *plain(volatile void *value) { return const_cast<void *>(value); }
template <typename T> void **address(T **pin) { return (void **)pin; }

void *new_value() { return std::calloc(1, sizeof(hal_data_u)); }

std::string text_of(const char *format, va_list arguments) {
    char text[HAL_NAME_LEN + 1];
    std::vsnprintf(text, sizeof text, format, arguments);
    return text;
}

bool is_bit(const std::string &text, bool &value) {
    value = text == "1" || !strcasecmp(text.c_str(), "true");
    return value || text == "0" || !strcasecmp(text.c_str(), "false");
}
}

namespace pins {
int add(const std::string &name, hal_type_t type, bool is_output, void **where) {
    if (!all().emplace(name, Pin{type, is_output, where}).second) {
        return -EINVAL;
    }
    if (!*where) {
        *where = new_value();
    }
    return 0;
}

void *find_any(const std::string &name) {
    const auto found = all().find(name);
    return found == all().end() ? nullptr : *found->second.where;
}

bool set(const std::string &name, const std::string &text) {
    const auto found = all().find(name);
    if (found == all().end()) {
        return false;
    }
    void *value = *found->second.where;
    char *end = nullptr;
    switch (found->second.type) {
    case HAL_BIT: return is_bit(text, *static_cast<bool *>(value));
    case HAL_FLOAT: *static_cast<double *>(value) = std::strtod(text.c_str(), &end); break;
    case HAL_S32: *static_cast<int *>(value) = static_cast<int>(std::strtol(text.c_str(), &end, 10)); break;
    case HAL_U32:
        *static_cast<unsigned *>(value) = static_cast<unsigned>(std::strtoul(text.c_str(), &end, 10));
        break;
    default: return false;
    }
    return end != text.c_str() && *end == 0;
}

std::string names_like(const std::string &pattern) {
    std::string names;
    for (const auto &pin : all()) {
        if (fnmatch(pattern.c_str(), pin.first.c_str(), 0) == 0) {
            names += pin.first + " ";
        }
    }
    return names;
}

bool net(const std::string &signal, const std::string &pin) {
    const auto found = all().find(pin);
    if (found == all().end()) {
        return false;
    }
    const auto made = signals().emplace(signal, nullptr);
    void *&value = made.first->second;
    if (made.second) {
        value = new_value();
    }
    if (found->second.is_output) {
        std::memcpy(value, *found->second.where, sizeof(hal_data_u));
    }
    *found->second.where = value;
    return true;
}
}

namespace thread {
bool add(const std::string &function) {
    const auto found = functions().find(function);
    if (found == functions().end()) {
        return false;
    }
    in_thread().push_back(found->second);
    return true;
}

void run(long period) {
    moves::cycle();
    for (const Function &function : in_thread()) {
        function.call(function.argument, period);
    }
}
}

// ---- what components call

REPLACES int hal_init(const char *) {
    static int last = 0;
    return ++last;
}
REPLACES int hal_ready(int) { return 0; }
REPLACES int hal_exit(int) { return 0; }
REPLACES void *hal_malloc(long size) { return std::calloc(1, static_cast<size_t>(size)); }
REPLACES int hal_start_threads(void) { return 0; }
REPLACES int hal_stop_threads(void) { return 0; }
REPLACES int hal_create_thread(const char *, unsigned long period, int) {
    clock_::set_period(period);
    return 0;
}
REPLACES int hal_export_funct(const char *name, void (*call)(void *, long), void *argument, int, int, int) {
    return functions().emplace(name, Function{call, argument}).second ? 0 : -EINVAL;
}
REPLACES int hal_export_functf(void (*call)(void *, long), void *argument, int, int, int, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    const std::string name = text_of(format, arguments);
    va_end(arguments);
    return functions().emplace(name, Function{call, argument}).second ? 0 : -EINVAL;
}

// The value of a pin or parameter by its name, as #<_hal[...]> of a program reads it.
static int value_by_name(const char *name, hal_type_t *type, hal_data_u **data) {
    const auto found = all().find(name);
    if (found == all().end()) {
        return -EINVAL;
    }
    *type = found->second.type;
    *data = static_cast<hal_data_u *>(*found->second.where);
    return 0;
}
REPLACES int hal_get_pin_value_by_name(const char *name, hal_type_t *type, hal_data_u **data, bool *has_writer) {
    *has_writer = false;
    return value_by_name(name, type, data);
}
REPLACES int hal_get_param_value_by_name(const char *name, hal_type_t *type, hal_data_u **data) {
    return value_by_name(name, type, data);
}
REPLACES int hal_get_signal_value_by_name(const char *, hal_type_t *, hal_data_u **, bool *) { return -EINVAL; }

#define PIN_AND_PARAMETER(NAME, TYPE, VALUE)                                                                 \
    REPLACES int hal_pin_##NAME##_newf(hal_pin_dir_t direction, VALUE **pin, int, const char *format, ...) { \
        va_list arguments;                                                                                   \
        va_start(arguments, format);                                                                         \
        const std::string name = text_of(format, arguments);                                                 \
        va_end(arguments);                                                                                   \
        *pin = nullptr;                                                                                      \
        return pins::add(name, TYPE, direction != HAL_IN, address(pin));                   \
    }                                                                                                        \
    REPLACES int hal_pin_##NAME##_new(const char *name, hal_pin_dir_t direction, VALUE **pin, int) {         \
        *pin = nullptr;                                                                                      \
        return pins::add(name, TYPE, direction != HAL_IN, address(pin));                   \
    }                                                                                                        \
    REPLACES int hal_param_##NAME##_new(const char *name, hal_param_dir_t, VALUE *value, int) {              \
        return pins::add(name, TYPE, true, new void *(plain(value))); \
    }                                                                                                        \
    REPLACES int hal_param_##NAME##_newf(hal_param_dir_t, VALUE *value, int, const char *format, ...) {      \
        va_list arguments;                                                                                   \
        va_start(arguments, format);                                                                         \
        const std::string name = text_of(format, arguments);                                                 \
        va_end(arguments);                                                                                   \
        return pins::add(name, TYPE, true, new void *(plain(value))); \
    }

PIN_AND_PARAMETER(bit, HAL_BIT, hal_bit_t)
PIN_AND_PARAMETER(float, HAL_FLOAT, hal_float_t)
PIN_AND_PARAMETER(s32, HAL_S32, hal_s32_t)
PIN_AND_PARAMETER(u32, HAL_U32, hal_u32_t)
