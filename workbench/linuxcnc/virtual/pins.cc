// SPDX-License-Identifier: GPL-2.0-or-later
// HAL for one process: pins, parameters, signals and functions, in the process's memory.

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
    // HAL_IN, HAL_OUT or HAL_IO; for a parameter HAL_RO or HAL_RW.
    int direction;
    bool is_parameter;
    // The pointer that the component reads and writes through.
    void **where;
    // Its signal, if any.
    std::string signal;
};

struct Signal {
    hal_type_t type;
    void *value;
    // Pins that write it: with HAL_OUT, and with HAL_IO.
    std::string writer, other;
};

struct Function {
    void (*call)(void *, long);
    void *argument;
    bool is_called;
};

std::map<std::string, Pin> &all() {
    static std::map<std::string, Pin> pins;
    return pins;
}

std::map<std::string, Signal> &signals() {
    static std::map<std::string, Signal> signals;
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
int add(const std::string &name, hal_type_t type, int direction, void **where, bool is_parameter) {
    if (name.size() > HAL_NAME_LEN || !all().emplace(name, Pin{type, direction, is_parameter, where, ""}).second) {
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

static bool assign(void *value, hal_type_t type, const std::string &text) {
    char *end = nullptr;
    switch (type) {
    case HAL_BIT: return is_bit(text, *static_cast<bool *>(value));
    case HAL_FLOAT: *static_cast<double *>(value) = std::strtod(text.c_str(), &end); break;
    case HAL_S32: *static_cast<int *>(value) = static_cast<int>(std::strtol(text.c_str(), &end, 0)); break;
    case HAL_U32:
        *static_cast<unsigned *>(value) = static_cast<unsigned>(std::strtoul(text.c_str(), &end, 0));
        break;
    default: return false;
    }
    return end != text.c_str() && *end == 0;
}

std::string set(const std::string &name, const std::string &text) {
    const auto found = all().find(name);
    if (found == all().end()) {
        return "there is no pin or parameter " + name;
    }
    const Pin &pin = found->second;
    if (!pin.signal.empty()) {
        return "pin " + name + " is on signal " + pin.signal + ", which sets it";
    }
    if (pin.is_parameter ? pin.direction == HAL_RO : pin.direction == HAL_OUT) {
        return name + " is not writable";
    }
    return assign(*pin.where, pin.type, text) ? "" : name + " takes no value " + text;
}

bool get(const std::string &name, std::string &text) {
    const auto found = all().find(name);
    if (found == all().end()) {
        return false;
    }
    const void *value = *found->second.where;
    char number[32] = "";
    switch (found->second.type) {
    case HAL_BIT: text = *static_cast<const bool *>(value) ? "TRUE" : "FALSE"; return true;
    case HAL_FLOAT: std::snprintf(number, sizeof number, "%.7g", *static_cast<const double *>(value)); break;
    case HAL_S32: std::snprintf(number, sizeof number, "%d", *static_cast<const int *>(value)); break;
    case HAL_U32: std::snprintf(number, sizeof number, "%u", *static_cast<const unsigned *>(value)); break;
    default: return false;
    }
    text = number;
    return true;
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

std::string new_signal(const std::string &name, hal_type_t type) {
    if (name.size() > HAL_NAME_LEN) {
        return "the name of signal " + name + " is too long";
    }
    return signals().emplace(name, Signal{type, new_value(), "", ""}).second ? "" : "signal " + name + " exists already";
}

std::string new_signal(const std::string &name, const std::string &type) {
    static const std::map<std::string, hal_type_t> types{
        {"bit", HAL_BIT}, {"float", HAL_FLOAT}, {"s32", HAL_S32}, {"u32", HAL_U32}};
    const auto found = types.find(type);
    return found == types.end() ? "there is no type " + type : new_signal(name, found->second);
}

std::string set_signal(const std::string &name, const std::string &text) {
    const auto found = signals().find(name);
    if (found == signals().end()) {
        return "there is no signal " + name;
    }
    if (!found->second.writer.empty()) {
        return "signal " + name + " has a writer already, " + found->second.writer;
    }
    return assign(found->second.value, found->second.type, text) ? "" : "signal " + name + " takes no value " + text;
}

std::string net(const std::string &signal, const std::string &pin) {
    const auto found = all().find(pin);
    if (found == all().end() || found->second.is_parameter) {
        return "there is no pin " + pin;
    }
    Pin &own = found->second;
    if (own.signal == signal) {
        return "";
    }
    if (!own.signal.empty()) {
        return "pin " + pin + " is on signal " + own.signal + " already";
    }
    const bool is_new = signals().count(signal) == 0;
    const std::string refused = is_new ? new_signal(signal, own.type) : "";
    if (!refused.empty()) {
        return refused;
    }
    Signal &made = signals()[signal];
    if (made.type != own.type) {
        return "signal " + signal + " and pin " + pin + " are of different types";
    }
    if (own.direction == HAL_OUT && !(made.writer + made.other).empty()) {
        return "signal " + signal + " has a writer already, " + made.writer + made.other + ", and " + pin + " writes too";
    }
    if (own.direction == HAL_IO && !made.writer.empty()) {
        return "signal " + signal + " has a writer already, " + made.writer + ", and " + pin + " writes too";
    }
    if (own.direction != HAL_IN) {
        (own.direction == HAL_OUT ? made.writer : made.other) = pin;
        std::memcpy(made.value, *own.where, sizeof(hal_data_u));
    }
    *own.where = made.value;
    own.signal = signal;
    return "";
}

std::string unlink(const std::string &name) {
    const auto found = all().find(name);
    if (found == all().end() || found->second.is_parameter) {
        return "there is no pin " + name;
    }
    Pin &pin = found->second;
    if (pin.signal.empty()) {
        return "";
    }
    Signal &signal = signals()[pin.signal];
    for (std::string *writer : {&signal.writer, &signal.other}) {
        *writer = *writer == name ? "" : *writer;
    }
    // The pin keeps the signal's value.
    *pin.where = std::memcpy(new_value(), signal.value, sizeof(hal_data_u));
    pin.signal.clear();
    return "";
}
}

namespace thread {
std::string add(const std::string &function) {
    const auto found = functions().find(function);
    if (found == functions().end()) {
        return "there is no function " + function;
    }
    if (found->second.is_called) {
        return "function " + function + " is in a thread already";
    }
    found->second.is_called = true;
    in_thread().push_back(found->second);
    return "";
}

void run(long period) {
    moves::cycle();
    for (const Function &function : in_thread()) {
        function.call(function.argument, period);
    }
}
}

// ---- functions that components call

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
    return functions().emplace(name, Function{call, argument, false}).second ? 0 : -EINVAL;
}
REPLACES int hal_export_functf(void (*call)(void *, long), void *argument, int, int, int, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    const std::string name = text_of(format, arguments);
    va_end(arguments);
    return functions().emplace(name, Function{call, argument, false}).second ? 0 : -EINVAL;
}

// Returns the value of a pin or parameter by its name, as #<_hal[...]> of a program reads it.
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
        return pins::add(name, TYPE, direction, address(pin));                                               \
    }                                                                                                        \
    REPLACES int hal_pin_##NAME##_new(const char *name, hal_pin_dir_t direction, VALUE **pin, int) {         \
        *pin = nullptr;                                                                                      \
        return pins::add(name, TYPE, direction, address(pin));                                               \
    }                                                                                                        \
    REPLACES int hal_param_##NAME##_new(const char *name, hal_param_dir_t direction, VALUE *value, int) {    \
        return pins::add(name, TYPE, direction, new void *(plain(value)), true);                             \
    }                                                                                                        \
    REPLACES int hal_param_##NAME##_newf(hal_param_dir_t direction, VALUE *value, int, const char *format, ...) { \
        va_list arguments;                                                                                   \
        va_start(arguments, format);                                                                         \
        const std::string name = text_of(format, arguments);                                                 \
        va_end(arguments);                                                                                   \
        return pins::add(name, TYPE, direction, new void *(plain(value)), true);                             \
    }

PIN_AND_PARAMETER(bit, HAL_BIT, hal_bit_t)
PIN_AND_PARAMETER(float, HAL_FLOAT, hal_float_t)
PIN_AND_PARAMETER(s32, HAL_S32, hal_s32_t)
PIN_AND_PARAMETER(u32, HAL_U32, hal_u32_t)
