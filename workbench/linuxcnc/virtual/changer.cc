// SPDX-License-Identifier: GPL-2.0-or-later
// LinuxCNC's `io`, which is a separate process in 2.9: estop, coolant and the tool changer. It answers
// milltask through the buffers toolCmd and toolSts, and uses pins that the HAL files connect.

#include "virtual.h"

#include <rcs.hh>
#include <emc.hh>
#include <emc_nml.hh>
#include <emccfg.h>
#include <emctool.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>

// LinuxCNC's tool table; its header is not installed.
CANON_TOOL_TABLE tooldata_entry_init();
int tooldata_get(CANON_TOOL_TABLE *entry, int index);
int tooldata_put(CANON_TOOL_TABLE entry, int index);
int tooldata_find_index_for_tool(int tool);
int tooldata_last_index_get();
void tooldata_init(bool is_random);
void tooldata_reset();
int tooldata_load(const char *file, char **comments);
int tooldata_save(const char *file, char **comments);
int tool_mmap_creator(const EMC_TOOL_STAT *status, int is_random);

namespace {
// Nanoseconds between two reads of the pins by `io`: [EMCIO]CYCLE_TIME, read as `io` reads it.
long long cycle() {
    double seconds = DEFAULT_EMC_IO_CYCLE_TIME;
    std::sscanf(environment::value("PKMKINS_VIRTUAL_CHANGER_CYCLE"), "%lf", &seconds);
    return std::llround(1e9 * seconds);
}

struct Pins {
    hal_bit_t *enable_out, *request_enable, *enable_in, *flood, *mist, *lube, *lube_level;
    hal_bit_t *prepare, *prepared, *change, *changed;
    hal_s32_t *number, *prep_number, *prep_index, *prep_pocket, *from_pocket;
} io;

RCS_CMD_CHANNEL *commands;
RCS_STAT_CHANNEL *answers;
EMC_IO_STAT *status;
long long due = 0;
bool is_random = false;

const char *table() { return environment::value("PKMKINS_VIRTUAL_TOOLS"); }

void put_into_spindle(int index) {
    CANON_TOOL_TABLE tool = tooldata_entry_init(), spindle = tool;
    tooldata_get(&tool, index);
    tooldata_get(&spindle, 0);
    if (is_random) {
        // Swap the two pockets.
        spindle.pocketno = tool.pocketno;
        tooldata_put(spindle, index);
        tool.pocketno = 0;
    } else if (index == 0) {
        tool = tooldata_entry_init();
        tool.toolno = tool.pocketno = 0;
    }
    tooldata_put(tool, 0);
}

void reload() {
    tooldata_reset();
    tooldata_load(table(), nullptr);
    for (int index = 1; !is_random && index <= tooldata_last_index_get(); index++) {
        CANON_TOOL_TABLE tool = tooldata_entry_init();
        tooldata_get(&tool, index);
        if (tool.toolno == status->tool.toolInSpindle) {
            put_into_spindle(index);
            return;
        }
    }
}

void prepare(int number) {
    const int index = tooldata_find_index_for_tool(number);
    status->tool.pocketPrepped = index;
    CANON_TOOL_TABLE tool = tooldata_entry_init();
    if (index < 0) {
        return;
    }
    tooldata_get(&tool, index);
    *io.prep_index = index;
    *io.prep_number = index == 0 && !is_random ? 0 : tool.toolno;
    *io.prep_pocket = index == 0 ? 0 : tool.pocketno;
    if (!(is_random && index == 0)) {
        *io.prepare = true;
        status->status = RCS_STATUS::RCS_EXEC;
    }
}

void change() {
    const int index = status->tool.pocketPrepped;
    CANON_TOOL_TABLE tool = tooldata_entry_init();
    if (index < 0 || (is_random && index == 0)) {
        return;
    }
    tooldata_get(&tool, index);
    if (!is_random && index > 0 && status->tool.toolInSpindle == tool.toolno) {
        return;
    }
    *io.change = true;
    status->status = RCS_STATUS::RCS_EXEC;
}

void set_offset(const EMC_TOOL_SET_OFFSET &wanted) {
    CANON_TOOL_TABLE tool = tooldata_entry_init();
    tooldata_get(&tool, wanted.pocket);
    tool.toolno = wanted.toolno;
    tool.offset = wanted.offset;
    tool.diameter = wanted.diameter;
    tool.frontangle = wanted.frontangle;
    tool.backangle = wanted.backangle;
    tool.orientation = wanted.orientation;
    tooldata_put(tool, wanted.pocket);
    if (tooldata_save(table(), nullptr) != 0) {
        status->status = RCS_STATUS::RCS_ERROR;
    }
}

void set_number(int index) {
    put_into_spindle(index);
    CANON_TOOL_TABLE tool = tooldata_entry_init();
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

void turn(hal_bit_t *pin, int &reported, bool on) {
    *pin = on;
    reported = on;
}

void obey(RCS_CMD_MSG *command) {
    status->status = RCS_STATUS::RCS_DONE;
    switch (command->type) {
    case EMC_TOOL_INIT_TYPE:
    case EMC_TOOL_LOAD_TOOL_TABLE_TYPE: reload(); break;
    case EMC_TOOL_ABORT_TYPE: stop_changing(); break;
    case EMC_TOOL_PREPARE_TYPE: prepare(static_cast<EMC_TOOL_PREPARE *>(command)->tool); break;
    case EMC_TOOL_LOAD_TYPE: change(); break;
    case EMC_TOOL_UNLOAD_TYPE: status->tool.toolInSpindle = 0; break;
    case EMC_TOOL_SET_OFFSET_TYPE: set_offset(*static_cast<EMC_TOOL_SET_OFFSET *>(command)); break;
    case EMC_TOOL_SET_NUMBER_TYPE: set_number(static_cast<EMC_TOOL_SET_NUMBER *>(command)->tool); break;
    case EMC_COOLANT_MIST_ON_TYPE: turn(io.mist, status->coolant.mist, true); break;
    case EMC_COOLANT_MIST_OFF_TYPE: turn(io.mist, status->coolant.mist, false); break;
    case EMC_COOLANT_FLOOD_ON_TYPE: turn(io.flood, status->coolant.flood, true); break;
    case EMC_COOLANT_FLOOD_OFF_TYPE: turn(io.flood, status->coolant.flood, false); break;
    case EMC_AUX_ESTOP_ON_TYPE: enable(false); break;
    case EMC_AUX_ESTOP_OFF_TYPE: enable(true); break;
    case EMC_LUBE_ON_TYPE: turn(io.lube, status->lube.on, true); break;
    case EMC_LUBE_OFF_TYPE: turn(io.lube, status->lube.on, false); break;
    default: break;
    }
}

// Returns whether the pins have changed the answer.
bool looks_at_pins() {
    const EMC_AUX_STAT before = status->aux;
    status->aux.estop = !*io.enable_in;
    bool news = status->aux.estop != before.estop;
    if (*io.prepare && *io.prepared) {
        *io.prepare = false;
        status->status = RCS_STATUS::RCS_DONE;
        news = true;
    }
    if (*io.change && *io.changed) {
        put_into_spindle(status->tool.pocketPrepped);
        CANON_TOOL_TABLE tool = tooldata_entry_init();
        tooldata_get(&tool, 0);
        status->tool.toolFromPocket = *io.from_pocket = *io.prep_pocket;
        status->tool.toolInSpindle = *io.number = tool.toolno;
        status->tool.pocketPrepped = -1;
        *io.prep_number = *io.prep_index = *io.prep_pocket = 0;
        *io.change = false;
        status->status = RCS_STATUS::RCS_DONE;
        news = true;
    }
    return news;
}

void answer(NMLTYPE type, int serial) {
    status->command_type = type;
    status->echo_serial_number = serial;
    status->heartbeat++;
    answers->write(status);
}

// On the heap: milltask constructs EMC_TOOL_STAT.
void begin() {
    status = new EMC_IO_STAT;
    status->status = RCS_STATUS::RCS_DONE;
    status->aux.estop = 1;
    status->tool.pocketPrepped = -1;
    status->lube.level = 1;
    CANON_TOOL_TABLE spindle = tooldata_entry_init();
    if (is_random && tooldata_get(&spindle, 0) == 0) {
        status->tool.toolInSpindle = spindle.toolno;
    }
    answer(EMC_IO_STAT_TYPE, 0);
}

template <typename Channel> Channel *opened(const char *name) {
    const std::string file = std::string(environment::folder()) + "/buffers.nml";
    auto *channel = new Channel(emcFormat, name, "pkmkins", file.c_str());
    if (!channel->valid()) {
        give_up("the buffer %s cannot be opened", name);
    }
    return channel;
}

template <typename T> void bit(T **pin, const char *name, hal_type_t type, int direction) {
    *pin = nullptr;
    pins::add(std::string("iocontrol.0.") + name, type, direction, (void **)pin);
}
}

namespace changer {
void export_pins() {
    const auto out = [](hal_bit_t **pin, const char *name) { bit(pin, name, HAL_BIT, HAL_OUT); };
    const auto in = [](hal_bit_t **pin, const char *name) { bit(pin, name, HAL_BIT, HAL_IN); };
    const auto number = [](hal_s32_t **pin, const char *name) { bit(pin, name, HAL_S32, HAL_OUT); };
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

void open_buffers() {
    for (const char *name : {"emcCommand", "emcStatus", "emcError"}) {
        opened<RCS_STAT_CHANNEL>(name);
    }
    commands = opened<RCS_CMD_CHANNEL>("toolCmd");
    answers = opened<RCS_STAT_CHANNEL>("toolSts");
}

void open_tool_data() {
    is_random = environment::value("PKMKINS_VIRTUAL_RANDOM_TOOLS")[0] == '1';
    tooldata_init(is_random);
    tool_mmap_creator(nullptr, is_random);
    tooldata_reset();
    if (!is_random) {
        CANON_TOOL_TABLE spindle = tooldata_entry_init();
        spindle.pocketno = 0;
        spindle.toolno = -1;
        tooldata_put(spindle, 0);
    }
    if (*table() && tooldata_load(table(), nullptr) != 0) {
        give_up("%s: LinuxCNC cannot read this tool table", table());
    }
}

void step() {
    if (clock_::now() < due) {
        return;
    }
    static const long long wait = cycle();
    due = clock_::now() + wait;
    if (!status) {
        begin();
    }
    if (looks_at_pins()) {
        answer(EMC_IO_STAT_TYPE, status->echo_serial_number);
    }
    if (commands->read() == -1) {
        return;
    }
    auto *command = static_cast<RCS_CMD_MSG *>(commands->get_address());
    if (!command || command->type == 0 || command->serial_number == status->echo_serial_number) {
        return;
    }
    obey(command);
    looks_at_pins();
    answer(command->type, command->serial_number);
}
}
