// SPDX-License-Identifier: GPL-2.0-or-later
// LinuxCNC's `io`, which is a separate process in 2.9: estop, coolant and the tool changer. It answers
// milltask through the buffers toolCmd and toolSts, and uses pins that the HAL files connect. In later versions
// milltask does this itself.

#include "virtual.h"

#include <dlfcn.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace {
// Messages of all versions 2.9, and the numbers that they use.
enum Status { DONE = 1, EXECUTES = 2, FAILED = 3 };
enum Type {
    TOOL_INIT = 1101,
    TOOL_ABORT = 1103,
    TOOL_PREPARE = 1104,
    TOOL_LOAD = 1105,
    TOOL_UNLOAD = 1106,
    TOOL_LOAD_TABLE = 1107,
    TOOL_SET_OFFSET = 1108,
    TOOL_SET_NUMBER = 1109,
    TOOL_STATUS = 1199,
    ESTOP_ON = 1206,
    ESTOP_OFF = 1207,
    AUX_STATUS = 1299,
    MIST_ON = 1404,
    MIST_OFF = 1405,
    FLOOD_ON = 1406,
    FLOOD_OFF = 1407,
    COOLANT_STATUS = 1499,
    LUBE_ON = 1504,
    LUBE_OFF = 1505,
    LUBE_STATUS = 1599,
    IO_STATUS = 1699,
};
struct Message {
    int type;
    long size;
};
struct Command : Message {
    int serial_number;
};
struct Prepare : Command {
    int tool;
};
struct SetOffset : Command {
    int pocket, toolno;
    double offset[9], diameter, frontangle, backangle;
    int orientation;
};
struct Answer : Message {
    int command_type, echo_serial_number, status, state, line, source_line;
    char source_file[64];
};
struct Tool {
    int toolno = -1, pocketno = -1;
    double offset[9] = {}, diameter = 0.0, frontangle = 0.0, backangle = 0.0;
    int orientation = 0;
};
struct ToolStatus : Answer {
    int pocketPrepped, toolInSpindle, toolFromPocket;
    Tool current;
};
struct CoolantStatus : Answer {
    int mist, flood;
};
struct AuxStatus : Answer {
    int estop;
};
struct LubeStatus : Answer {
    int on, level;
};
struct IoStatus : Answer {
    unsigned heartbeat;
    double cycle_time;
    int debug, reason, fault;
    ToolStatus tool;
    CoolantStatus coolant;
    AuxStatus aux;
    LubeStatus lube;
};
// The sizes that milltask's messages have.
static_assert(sizeof(Prepare) == 24 && sizeof(SetOffset) == 136 && sizeof(IoStatus) == 704 && sizeof(Tool) == 112);

// A function of LinuxCNC's; headers declare only some of them.
template <typename Call> Call needed(const char *name) {
    const auto call = reinterpret_cast<Call>(dlsym(RTLD_DEFAULT, name));
    if (!call) {
        give_up("this LinuxCNC has no function %s", name);
    }
    return call;
}
#define LINUXCNC(RESULT, NAME, SYMBOL, ...)                               \
    template <typename... Values> RESULT NAME(Values... values) {         \
        static const auto call = needed<RESULT (*)(__VA_ARGS__)>(SYMBOL); \
        return call(values...);                                           \
    }
LINUXCNC(int, tooldata_get, "_Z12tooldata_getP16CANON_TOOL_TABLEi", Tool *, int)
LINUXCNC(int, tooldata_put, "_Z12tooldata_put16CANON_TOOL_TABLEi", Tool, int)
LINUXCNC(int, tooldata_find, "_Z28tooldata_find_index_for_tooli", int)
LINUXCNC(int, tooldata_last, "_Z23tooldata_last_index_getv")
LINUXCNC(void, tooldata_init, "_Z13tooldata_initb", bool)
LINUXCNC(void, tooldata_reset, "_Z14tooldata_resetv")
LINUXCNC(int, tooldata_load, "_Z13tooldata_loadPKcPPc", const char *, char **)
LINUXCNC(int, tooldata_save, "_Z13tooldata_savePKcPPc", const char *, char **)
LINUXCNC(int, tool_mmap_creator, "_Z17tool_mmap_creatorPK13EMC_TOOL_STATi", const void *, int)
LINUXCNC(int, nml_read, "_ZN3NML4readEv", void *)
LINUXCNC(void *, nml_address, "_ZN3NML11get_addressEv", void *)
LINUXCNC(int, nml_write, "_ZN3NML5writeEP6NMLmsgPi", void *, Message *, int *)

// Nanoseconds between two reads of the pins by `io`: [EMCIO]CYCLE_TIME, read as `io` reads it.
constexpr double CYCLE_TIME = 0.1;
long long cycle() {
    double seconds = CYCLE_TIME;
    std::sscanf(environment::value("PKMKINS_VIRTUAL_CHANGER_CYCLE"), "%lf", &seconds);
    return std::llround(1e9 * seconds);
}

struct Pins {
    bool *enable_out, *request_enable, *enable_in, *flood, *mist, *lube, *lube_level;
    bool *prepare, *prepared, *change, *changed;
    int *number, *prep_number, *prep_index, *prep_pocket, *from_pocket;
} io;

// Whether this process has a changer; its channels.
bool is_separate = false;
void *commands, *answers;
IoStatus *status;
long long due = 0;
bool is_random = false;

const char *table() { return environment::value("PKMKINS_VIRTUAL_TOOLS"); }

void put_into_spindle(int index) {
    Tool tool, spindle;
    tooldata_get(&tool, index);
    tooldata_get(&spindle, 0);
    if (is_random) {
        // Swap the two pockets.
        spindle.pocketno = tool.pocketno;
        tooldata_put(spindle, index);
        tool.pocketno = 0;
    } else if (index == 0) {
        tool = {};
        tool.toolno = tool.pocketno = 0;
    }
    tooldata_put(tool, 0);
}

void reload() {
    tooldata_reset();
    tooldata_load(table(), nullptr);
    for (int index = 1; !is_random && index <= tooldata_last(); index++) {
        Tool tool;
        tooldata_get(&tool, index);
        if (tool.toolno == status->tool.toolInSpindle) {
            put_into_spindle(index);
            return;
        }
    }
}

void prepare(int number) {
    const int index = tooldata_find(number);
    status->tool.pocketPrepped = index;
    Tool tool;
    if (index < 0) {
        return;
    }
    tooldata_get(&tool, index);
    *io.prep_index = index;
    *io.prep_number = index == 0 && !is_random ? 0 : tool.toolno;
    *io.prep_pocket = index == 0 ? 0 : tool.pocketno;
    if (!(is_random && index == 0)) {
        *io.prepare = true;
        status->status = EXECUTES;
    }
}

void change() {
    const int index = status->tool.pocketPrepped;
    Tool tool;
    if (index < 0 || (is_random && index == 0)) {
        return;
    }
    tooldata_get(&tool, index);
    if (!is_random && index > 0 && status->tool.toolInSpindle == tool.toolno) {
        return;
    }
    *io.change = true;
    status->status = EXECUTES;
}

void set_offset(const SetOffset &wanted) {
    Tool tool;
    tooldata_get(&tool, wanted.pocket);
    tool.toolno = wanted.toolno;
    std::copy_n(wanted.offset, 9, tool.offset);
    tool.diameter = wanted.diameter;
    tool.frontangle = wanted.frontangle;
    tool.backangle = wanted.backangle;
    tool.orientation = wanted.orientation;
    tooldata_put(tool, wanted.pocket);
    if (tooldata_save(table(), nullptr) != 0) {
        status->status = FAILED;
    }
}

void set_number(int index) {
    put_into_spindle(index);
    Tool tool;
    tooldata_get(&tool, 0);
    status->tool.toolInSpindle = tool.toolno;
    *io.number = tool.toolno;
}

void stop_changing() {
    status->coolant.mist = status->coolant.flood = 0;
    *io.mist = *io.flood = *io.change = *io.prepare = false;
}

void enable(bool on) {
    *io.enable_out = on;
    *io.request_enable = on;
}

void turn(bool *pin, int &reported, bool on) {
    *pin = on;
    reported = on;
}

template <typename T> const T &as(const Command *command) {
    if (command->size != sizeof(T)) {
        give_up("this LinuxCNC has a command of %ld bytes to the tool changer, where %zu are known", command->size,
                sizeof(T));
    }
    return *static_cast<const T *>(command);
}

void obey(const Command *command) {
    status->status = DONE;
    switch (command->type) {
    case TOOL_INIT:
    case TOOL_LOAD_TABLE: reload(); break;
    case TOOL_ABORT: stop_changing(); break;
    case TOOL_PREPARE: prepare(as<Prepare>(command).tool); break;
    case TOOL_LOAD: change(); break;
    case TOOL_UNLOAD: status->tool.toolInSpindle = 0; break;
    case TOOL_SET_OFFSET: set_offset(as<SetOffset>(command)); break;
    case TOOL_SET_NUMBER: set_number(as<Prepare>(command).tool); break;
    case MIST_ON: turn(io.mist, status->coolant.mist, true); break;
    case MIST_OFF: turn(io.mist, status->coolant.mist, false); break;
    case FLOOD_ON: turn(io.flood, status->coolant.flood, true); break;
    case FLOOD_OFF: turn(io.flood, status->coolant.flood, false); break;
    case ESTOP_ON: enable(false); break;
    case ESTOP_OFF: enable(true); break;
    case LUBE_ON: turn(io.lube, status->lube.on, true); break;
    case LUBE_OFF: turn(io.lube, status->lube.on, false); break;
    default: break;
    }
}

// Returns whether the pins have changed the answer.
bool looks_at_pins() {
    const AuxStatus before = status->aux;
    status->aux.estop = !*io.enable_in;
    bool news = status->aux.estop != before.estop;
    if (*io.prepare && *io.prepared) {
        *io.prepare = false;
        status->status = DONE;
        news = true;
    }
    if (*io.change && *io.changed) {
        put_into_spindle(status->tool.pocketPrepped);
        Tool tool;
        tooldata_get(&tool, 0);
        status->tool.toolFromPocket = *io.from_pocket = *io.prep_pocket;
        status->tool.toolInSpindle = *io.number = tool.toolno;
        status->tool.pocketPrepped = -1;
        *io.prep_number = *io.prep_index = *io.prep_pocket = 0;
        *io.change = false;
        status->status = DONE;
        news = true;
    }
    return news;
}

void answer(int type, int serial) {
    status->command_type = type;
    status->echo_serial_number = serial;
    status->heartbeat++;
    nml_write(answers, status, nullptr);
}

template <typename T> void set_head(T &message, Type type) {
    message.type = type;
    message.size = sizeof message;
}

void begin() {
    status = new IoStatus{};
    set_head(*status, IO_STATUS);
    set_head(status->tool, TOOL_STATUS);
    set_head(status->coolant, COOLANT_STATUS);
    set_head(status->aux, AUX_STATUS);
    set_head(status->lube, LUBE_STATUS);
    status->status = DONE;
    status->aux.estop = 1;
    status->tool.pocketPrepped = -1;
    status->lube.level = 1;
    Tool spindle;
    if (is_random && tooldata_get(&spindle, 0) == 0) {
        status->tool.toolInSpindle = spindle.toolno;
    }
    answer(IO_STATUS, 0);
}

// Opens a channel, an RCS_STAT_CHANNEL, which is far smaller than its room. They all read and write alike.
void *opened(const char *name) {
    constexpr size_t ROOM = 1 << 14;
    static const auto construct = needed<void (*)(void *, void *, const char *, const char *, const char *, int)>(
        "_ZN16RCS_STAT_CHANNELC1EPFiiPvP3CMSEPKcS6_S6_i");
    static const auto is_valid = needed<int (*)(void *)>("_ZN3NML5validEv");
    const std::string file = std::string(environment::folder()) + "/buffers.nml";
    void *channel = std::calloc(1, ROOM);
    construct(channel, dlsym(RTLD_DEFAULT, "_Z9emcFormatiPvP3CMS"), name, "pkmkins", file.c_str(), 0);
    if (!is_valid(channel)) {
        give_up("the buffer %s cannot be opened", name);
    }
    return channel;
}

template <typename T> void bit(T **pin, const char *name, hal_type_t type, int direction) {
    *pin = nullptr;
    pins::add(std::string("iocontrol.0.") + name, type, direction, (void **)pin);
}

void export_pins() {
    const auto out = [](bool **pin, const char *name) { bit(pin, name, HAL_BIT, HAL_OUT); };
    const auto in = [](bool **pin, const char *name) { bit(pin, name, HAL_BIT, HAL_IN); };
    const auto number = [](int **pin, const char *name) { bit(pin, name, HAL_S32, HAL_OUT); };
    out(&io.enable_out, "user-enable-out");
    out(&io.request_enable, "user-request-enable");
    in(&io.enable_in, "emc-enable-in");
    out(&io.flood, "coolant-flood");
    out(&io.mist, "coolant-mist");
    out(&io.lube, "lube");
    in(&io.lube_level, "lube_level");
    out(&io.prepare, "tool-prepare");
    in(&io.prepared, "tool-prepared");
    out(&io.change, "tool-change");
    in(&io.changed, "tool-changed");
    number(&io.number, "tool-number");
    number(&io.prep_number, "tool-prep-number");
    number(&io.prep_index, "tool-prep-index");
    number(&io.prep_pocket, "tool-prep-pocket");
    number(&io.from_pocket, "tool-from-pocket");
}

void open_tool_data() {
    is_random = environment::value("PKMKINS_VIRTUAL_RANDOM_TOOLS")[0] == '1';
    tooldata_init(is_random);
    tool_mmap_creator(nullptr, is_random);
    tooldata_reset();
    if (!is_random) {
        Tool spindle;
        spindle.pocketno = 0;
        spindle.toolno = -1;
        tooldata_put(spindle, 0);
    }
    if (*table() && tooldata_load(table(), nullptr) != 0) {
        give_up("%s: LinuxCNC cannot read this tool table", table());
    }
}
}

namespace changer {
void start() {
    for (const char *name : {"emcCommand", "emcStatus", "emcError"}) {
        opened(name);
    }
    is_separate = !dlsym(RTLD_DEFAULT, "_ZN4Task18iocontrol_hal_initEv");
    if (!is_separate) {
        pins::expect("iocontrol.");
        return;
    }
    export_pins();
    commands = opened("toolCmd");
    answers = opened("toolSts");
    open_tool_data();
}

void step() {
    if (!is_separate || clock_::now() < due) {
        return;
    }
    static const long long wait = cycle();
    due = clock_::now() + wait;
    if (!status) {
        begin();
    }
    if (looks_at_pins()) {
        answer(IO_STATUS, status->echo_serial_number);
    }
    if (nml_read(commands) == -1) {
        return;
    }
    auto *command = static_cast<Command *>(nml_address(commands));
    if (!command || command->type == 0 || command->serial_number == status->echo_serial_number) {
        return;
    }
    obey(command);
    looks_at_pins();
    answer(command->type, command->serial_number);
}
}
