// SPDX-License-Identifier: GPL-2.0-or-later
// Executes the configuration: modules to load, pins to set, nets, functions of the servo thread. One step per line, its
// words separated by tabs:
//
//     load FILE NAME=VALUE...    addf FUNCTION    setp PIN VALUE    net SIGNAL PIN    newsig SIGNAL TYPE
//     sets SIGNAL VALUE    unlinkp PIN    list pin PATTERN    getp PIN    done
//
// Standard input has the steps from wiring.tcl; each is answered with a line on standard output, ok or error.

#include "virtual.h"

#include <ctype.h>
#include <dlfcn.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <iostream>
#include <sstream>
#include <vector>

namespace {
std::vector<std::string> split(const std::string &text, char at) {
    std::vector<std::string> parts;
    std::istringstream stream(text);
    for (std::string part; std::getline(stream, part, at);) {
        parts.push_back(part);
    }
    return parts;
}

// Sets load parameters: their address and type are symbols of the module. The type is i, l or s, with a
// number before it if the parameter is an array.
void set_parameter(void *module, const std::string &file, const std::string &name, const std::string &value) {
    void **address = static_cast<void **>(dlsym(module, ("rtapi_info_address_" + name).c_str()));
    char **type = static_cast<char **>(dlsym(module, ("rtapi_info_type_" + name).c_str()));
    if (!address || !type) {
        give_up("%s has no load parameter %s", file.c_str(), name.c_str());
    }
    const std::string kind = *type;
    const bool is_array = isdigit(static_cast<unsigned char>(kind[0]));
    const std::vector<std::string> values = is_array ? split(value, ',') : std::vector<std::string>{value};
    const size_t most = is_array ? static_cast<size_t>(std::atoi(kind.c_str())) : 1;
    if (values.size() > most) {
        give_up("%s: %s=%s: at most %zu values", file.c_str(), name.c_str(), value.c_str(), most);
    }
    for (size_t n = 0; n < values.size(); n++) {
        char *end = nullptr;
        const long number = std::strtol(values[n].c_str(), &end, 0);
        if (kind.back() != 's' && (*end != 0 || end == values[n].c_str())) {
            give_up("%s: %s=%s: expected a whole number", file.c_str(), name.c_str(), value.c_str());
        }
        switch (kind.back()) {
        case 'i': static_cast<int *>(*address)[n] = static_cast<int>(number); break;
        case 'l': static_cast<long *>(*address)[n] = number; break;
        case 's': static_cast<char **>(*address)[n] = strdup(values[n].c_str()); break;
        default: give_up("%s: parameter %s is of the unknown type %s", file.c_str(), name.c_str(), kind.c_str());
        }
    }
}

void load(const std::string &file, const std::vector<std::string> &parameters) {
    void *module = dlopen(file.c_str(), RTLD_NOW | RTLD_GLOBAL);
    if (!module) {
        give_up("%s", dlerror());
    }
    slots::check();
    for (const std::string &word : parameters) {
        const size_t equals = word.find('=');
        if (equals == std::string::npos) {
            give_up("%s: load parameter %s has no value", file.c_str(), word.c_str());
        }
        set_parameter(module, file, word.substr(0, equals), word.substr(equals + 1));
    }
    const auto start = reinterpret_cast<int (*)()>(dlsym(module, "rtapi_app_main"));
    const int code = start ? start() : -1;
    if (code != 0) {
        give_up("%s does not start (%d)", file.c_str(), code);
    }
}

std::string step(const std::string &line) {
    std::vector<std::string> words = split(line, '\t');
    if (words.size() > 1 && words[0] == "load") {
        load(words[1], {words.begin() + 2, words.end()});
        return "ok";
    }
    words.resize(3);
    const std::string &verb = words[0], &first = words[1], &second = words[2];
    if (verb == "list") {
        return "ok " + pins::names_like(second);
    }
    if (std::string value; verb == "getp" && pins::get(first, value)) {
        return "ok " + value;
    }
    const std::string refused = verb == "addf"     ? thread::add(first)
                                : verb == "setp"   ? pins::set(first, second)
                                : verb == "net"    ? pins::net(first, second)
                                : verb == "newsig" ? pins::new_signal(first, second)
                                : verb == "sets"   ? pins::set_signal(first, second)
                                : verb == "unlinkp" ? pins::unlink(first)
                                : verb == "getp"    ? "there is no pin or parameter " + first
                                : verb == "done"   ? ""
                                                   : "this cannot be done: " + line;
    return refused.empty() ? "ok" : "error: " + refused;
}
}

namespace wiring {
void follow() {
    for (std::string line; std::getline(std::cin, line);) {
        std::cout << step(line) << std::endl;
        if (line == "done") {
            // Standard output of milltask goes to its standard error.
            dup2(STDERR_FILENO, STDOUT_FILENO);
            return;
        }
    }
    give_up("the HAL files were not carried out");
}
}
