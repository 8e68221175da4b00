// SPDX-License-Identifier: GPL-2.0-or-later
// HAL for one process: pins, parameters, signals and functions, in the process's memory.

#include "virtual.h"

#include <dlfcn.h>
#include <errno.h>
#include <fnmatch.h>
#include <stdarg.h>
#include <strings.h>

#include <algorithm>
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
    // Whether its value has the room of the largest type.
    bool has_room;
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

// Bytes of a value of any type.
constexpr size_t VALUE = 8;
void *new_value() { return std::calloc(1, VALUE); }

// Prefixes of pins that milltask creates when it starts, and nets that wait for them: pins with their signals.
std::vector<std::string> &expected() {
    static std::vector<std::string> prefixes;
    return prefixes;
}
std::map<std::string, std::string> &early() {
    static std::map<std::string, std::string> nets;
    return nets;
}

// Returns the largest length of a name: HAL of 2.10 also has pins that are references.
size_t longest() {
    static const bool has_references = dlsym(RTLD_NEXT, "hal_pin_new_real") != nullptr;
    return has_references ? 55 : 47;
}

std::string text_of(const char *format, va_list arguments) {
    char text[256];
    std::vsnprintf(text, sizeof text, format, arguments);
    return text;
}

bool is_bit(const std::string &text, bool &value) {
    value = text == "1" || !strcasecmp(text.c_str(), "true");
    return value || text == "0" || !strcasecmp(text.c_str(), "false");
}
}

namespace pins {
int add(const std::string &name, hal_type_t type, int direction, void **where, bool is_parameter, bool has_room) {
    if (name.size() > longest() || !all().emplace(name, Pin{type, direction, is_parameter, has_room, where, ""}).second) {
        return -EINVAL;
    }
    if (!*where) {
        *where = new_value();
    }
    if (const auto found = early().find(name); found != early().end()) {
        const std::string refused = net(found->second, name);
        if (!refused.empty()) {
            give_up("%s", refused.c_str());
        }
        early().erase(found);
    }
    return 0;
}

void expect(const std::string &prefix) { expected().push_back(prefix); }

std::string missing() {
    return early().empty() ? ""
                           : "there is no pin " + early().begin()->first + " for signal " + early().begin()->second;
}

void *find_any(const std::string &name) {
    const auto found = all().find(name);
    return found == all().end() ? nullptr : *found->second.where;
}

// Values that HAL owns have room for the largest type, which pins of references use for the others: those of 32 bits
// are extended. Parameters of the older kind are in the component's own memory.
static bool assign(void *value, hal_type_t type, const std::string &text, bool has_room) {
    char *end = nullptr;
    long number = 0;
    unsigned long natural = 0;
    switch (type) {
    case HAL_BIT: return is_bit(text, *static_cast<bool *>(value));
    case HAL_FLOAT: *static_cast<double *>(value) = std::strtod(text.c_str(), &end); break;
    case HAL_S32:
        number = static_cast<int>(std::strtol(text.c_str(), &end, 0));
        std::memcpy(value, &number, has_room ? sizeof number : sizeof(int));
        break;
    case HAL_U32:
        natural = static_cast<unsigned>(std::strtoul(text.c_str(), &end, 0));
        std::memcpy(value, &natural, has_room ? sizeof natural : sizeof(unsigned));
        break;
    case HAL_S64: *static_cast<long *>(value) = std::strtol(text.c_str(), &end, 0); break;
    case HAL_U64: *static_cast<unsigned long *>(value) = std::strtoul(text.c_str(), &end, 0); break;
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
    return assign(*pin.where, pin.type, text, pin.has_room) ? "" : name + " takes no value " + text;
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
    case HAL_S64: std::snprintf(number, sizeof number, "%ld", *static_cast<const long *>(value)); break;
    case HAL_U64: std::snprintf(number, sizeof number, "%lu", *static_cast<const unsigned long *>(value)); break;
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
    if (name.size() > longest()) {
        return "the name of signal " + name + " is too long";
    }
    return signals().emplace(name, Signal{type, new_value(), "", ""}).second ? "" : "signal " + name + " exists already";
}

std::string new_signal(const std::string &name, const std::string &type) {
    static const std::map<std::string, hal_type_t> types{
        {"bit", HAL_BIT}, {"float", HAL_FLOAT}, {"s32", HAL_S32},
        {"u32", HAL_U32}, {"s64", HAL_S64},     {"u64", HAL_U64}};
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
    return assign(found->second.value, found->second.type, text, true) ? "" : "signal " + name + " takes no value " + text;
}

std::string net(const std::string &signal, const std::string &pin) {
    const auto found = all().find(pin);
    const auto is_prefix = [&](const std::string &prefix) { return pin.compare(0, prefix.size(), prefix) == 0; };
    if (found == all().end() && std::any_of(expected().begin(), expected().end(), is_prefix)) {
        const auto waiting = early().emplace(pin, signal).first;
        return waiting->second == signal ? "" : "pin " + pin + " is on signal " + waiting->second + " already";
    }
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
        std::memcpy(made.value, *own.where, VALUE);
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
    *pin.where = std::memcpy(new_value(), signal.value, VALUE);
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

void call(const std::string &function) {
    const auto found = functions().find(function);
    if (found == functions().end()) {
        give_up("there is no function %s", function.c_str());
    }
    found->second.call(found->second.argument, 1'000'000);
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
static int value_by_name(const char *name, hal_type_t *type, void **data) {
    const auto found = all().find(name);
    if (found == all().end()) {
        return -EINVAL;
    }
    *type = found->second.type;
    *data = *found->second.where;
    return 0;
}
REPLACES int hal_get_pin_value_by_name(const char *name, hal_type_t *type, void **data, bool *has_writer) {
    *has_writer = false;
    return value_by_name(name, type, data);
}
REPLACES int hal_get_param_value_by_name(const char *name, hal_type_t *type, void **data) {
    return value_by_name(name, type, data);
}
REPLACES int hal_get_signal_value_by_name(const char *, hal_type_t *, void **, bool *) { return -EINVAL; }

// The same of 2.10.
struct Query {
    const char *name;
    int kind;
    void *data;
    int type;
    void *reference;
    union {
        bool bit;
        double real;
        long whole;
        unsigned long natural;
    } value;
    int direction;
    const char *alias, *signal, *component;
    int component_id;
};
enum { ANY_KIND = 0, PIN_KIND = 1, PARAMETER_KIND = 2 };
REPLACES int hal_is_init(void) { return 1; }
REPLACES int hal_get_p(Query *query, int (*call)(Query *, void *), void *) {
    if (!query->name || query->kind < ANY_KIND || query->kind > PARAMETER_KIND || query->type || call) {
        give_up("this LinuxCNC reads pins in an unknown way");
    }
    const auto found = all().find(query->name);
    if (found == all().end() || (query->kind == PIN_KIND && found->second.is_parameter) ||
        (query->kind == PARAMETER_KIND && !found->second.is_parameter)) {
        return -ENOENT;
    }
    const Pin &pin = found->second;
    query->type = pin.type;
    query->reference = *pin.where;
    query->direction = pin.direction;
    query->signal = pin.signal.empty() ? nullptr : pin.signal.c_str();
    switch (pin.type) {
    case HAL_BIT: query->value.bit = *static_cast<bool *>(*pin.where); break;
    case HAL_S32: query->value.whole = *static_cast<int *>(*pin.where); break;
    case HAL_U32: query->value.natural = *static_cast<unsigned *>(*pin.where); break;
    default: std::memcpy(&query->value, *pin.where, VALUE); break;
    }
    return 0;
}
REPLACES int hal_get_s(Query *, int (*)(Query *, void *), void *) { return -ENOENT; }

#define NAME_FROM(FORMAT)                            \
    va_list arguments;                               \
    va_start(arguments, FORMAT);                     \
    const std::string name = text_of(FORMAT, arguments); \
    va_end(arguments);

#define PIN_AND_PARAMETER(NAME, TYPE)                                                                         \
    REPLACES int hal_pin_##NAME##_newf(int direction, void **pin, int, const char *format, ...) {             \
        NAME_FROM(format)                                                                                     \
        *pin = nullptr;                                                                                       \
        return pins::add(name, TYPE, direction, pin);                                                         \
    }                                                                                                         \
    REPLACES int hal_pin_##NAME##_new(const char *name, int direction, void **pin, int) {                     \
        *pin = nullptr;                                                                                       \
        return pins::add(name, TYPE, direction, pin);                                                         \
    }                                                                                                         \
    REPLACES int hal_param_##NAME##_new(const char *name, int direction, void *value, int) {                  \
        return pins::add(name, TYPE, direction, new void *(value), true, false);                                     \
    }                                                                                                         \
    REPLACES int hal_param_##NAME##_newf(int direction, void *value, int, const char *format, ...) {          \
        NAME_FROM(format)                                                                                     \
        return pins::add(name, TYPE, direction, new void *(value), true, false);                                     \
    }

PIN_AND_PARAMETER(bit, HAL_BIT)
PIN_AND_PARAMETER(float, HAL_FLOAT)
PIN_AND_PARAMETER(s32, HAL_S32)
PIN_AND_PARAMETER(u32, HAL_U32)

// Pins and parameters of 2.10 are references to values that HAL owns.
#define REFERENCE(NAME, TYPE, VALUE, STORED)                                                                  \
    REPLACES int hal_pin_new_##NAME(int, int direction, void **pin, VALUE first, const char *format, ...) {   \
        NAME_FROM(format)                                                                                     \
        *pin = new_value();                                                                                   \
        *static_cast<STORED *>(*pin) = first;                                                                 \
        return pins::add(name, TYPE, direction, pin);                                                         \
    }                                                                                                         \
    REPLACES int hal_param_new_##NAME(int, int direction, void **pin, VALUE first, const char *format, ...) { \
        NAME_FROM(format)                                                                                     \
        *pin = new_value();                                                                                   \
        *static_cast<STORED *>(*pin) = first;                                                                 \
        return pins::add(name, TYPE, direction, pin, true);                                                   \
    }

REFERENCE(bool, HAL_BIT, bool, bool)
REFERENCE(real, HAL_FLOAT, double, double)
REFERENCE(si32, HAL_S32, int, long)
REFERENCE(ui32, HAL_U32, unsigned, unsigned long)
REFERENCE(sint, HAL_S64, long, long)
REFERENCE(uint, HAL_U64, unsigned long, unsigned long)
