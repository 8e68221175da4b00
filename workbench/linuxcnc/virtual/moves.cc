// SPDX-License-Identifier: GPL-2.0-or-later
// What milltask asks motion for. Its commands stand in memory that both share; each is read in the cycle in which
// motion takes it, before motion does. No command carries the file that its line is in: the interpreter adds it.

#include "virtual.h"

#include <emcmotcfg.h>
#include <emctool.h>
#include <interp_base.hh>
#include <interp_return.hh>
#include <linuxcnc.h>
#include <modal_state.hh>
#include <motion.h>
#include <motion_types.h>
#include <rtapi_mutex.h>
#include <usrmotintf.h>

#include <dlfcn.h>
#include <elf.h>
#include <link.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace {
constexpr const char *ARC_FEED_NAME = "_Z8ARC_FEEDiddddiddddddd", *STRAIGHT_FEED_NAME = "_Z13STRAIGHT_FEEDiddddddddd",
                     *STRAIGHT_TRAVERSE_NAME = "_Z17STRAIGHT_TRAVERSEiddddddddd";

// The beginning of what motion and milltask share, which no installed header has. A mutex guards the command since
// 2.9.0; before, the command had counters of its own for that.
template <typename Command, typename = void> struct Begin {
    rtapi_mutex_t mutex;
};
template <typename Command> struct Begin<Command, std::void_t<decltype(Command::head)>> {};
struct Shared : Begin<emcmot_command_t> {
    emcmot_command_t command;
    emcmot_status_t status;
};

const Shared *shared = nullptr;
int last = 0;
// Blocks that the interpreter has read since the last cycle, and after how many it says where it is: inside a block of
// G71 it can go round for ever.
long read_on = 0;
constexpr long MOST_READ = 100'000;
// Moves since the program was started.
int count = 0;
// What later moves go by.
double tolerance = 0.0;
bool stops = false;
// How far a turn of the spindle goes, and whether that is a speed (G95) or a place (G33).
double pitch = 0.0;
bool is_speed = false;
int synched = 0;
// Where the last move ended, and the last S word.
double from_x = 0.0, word = 0.0;
const bool is_open = *environment::value("PKMKINS_VIRTUAL_OPEN");
// Beyond everything a machine reaches, and far from what overflows.
constexpr double FAR = 1e12;

// ---- the file of a move

// Files in the order in which they were read first; the program is the first.
std::vector<std::string> files;
InterpBase **interpreter = nullptr;
void (*update)(StateTag) = nullptr;

int file_that_is_read() {
    char name[PATH_MAX] = "";
    if (interpreter && *interpreter) {
        (*interpreter)->file_name(name, sizeof name);
    }
    for (size_t n = 0; n < files.size(); n++) {
        if (files[n] == name) {
            return static_cast<int>(n);
        }
    }
    files.push_back(name);
    record::file(name);
    return static_cast<int>(files.size()) - 1;
}

// The line of a block or move. What LinuxCNC makes of G70, G71 and G72 has line -1: it belongs to the block that is read.
int line_of(int line) {
    return line < 0 && interpreter && *interpreter ? (*interpreter)->sequence_number() : line;
}

// Cutter compensation holds moves back until a later block shows where they end. They then come out under the tag of
// that block, which may be in another file: each gets the tag of its own block again. The interpreter's queue of them,
// a vector, has no installed header.
struct Vector {
    const void *begin, *end;
};
const Vector &(*queue)() = nullptr;
// Tags of the blocks of which a move is held back, one of each at most, without the block that is carried out.
std::deque<StateTag> held;
StateTag carried_out;
bool has_come_out = false;

bool holds_back() { return queue().begin != queue().end; }

bool is_same_block(const StateTag &one, const StateTag &other) {
    return one.fields[GM_FIELD_LINE_NUMBER] == other.fields[GM_FIELD_LINE_NUMBER] &&
           one.fields_float[GM_FIELD_FLOAT_LINE_NUMBER] == other.fields_float[GM_FIELD_FLOAT_LINE_NUMBER];
}

// In place of UPDATE_TAG. The field holds the number of the line once more, as a float, which nobody reads.
void tag_file(StateTag tag) {
    if (++read_on == MOST_READ && interpreter && *interpreter) {
        record::reading((*interpreter)->sequence_number());
    }
    if (record::is_on()) {
        tag.fields_float[GM_FIELD_FLOAT_LINE_NUMBER] = static_cast<float>(file_that_is_read());
    }
    tag.fields[GM_FIELD_LINE_NUMBER] = line_of(tag.fields[GM_FIELD_LINE_NUMBER]);
    // All come out at once.
    if (has_come_out || !holds_back()) {
        held.clear();
    }
    has_come_out = false;
    if (holds_back() && !is_same_block(tag, carried_out)) {
        held.push_back(carried_out);
    }
    carried_out = tag;
    update(tag);
}

// Tags a move that was held back; others have their tag.
void tag_move(int line) {
    if (!holds_back()) {
        return;
    }
    has_come_out = true;
    const auto is_its = [line](const StateTag &tag) { return tag.fields[GM_FIELD_LINE_NUMBER] == line; };
    const auto found = std::find_if(held.begin(), held.end(), is_its);
    update(found != held.end() ? *found : carried_out);
    if (found != held.end()) {
        held.erase(held.begin(), found + 1);
    }
}

// In place of STRAIGHT_FEED and STRAIGHT_TRAVERSE.
using Straight = void (*)(int, double, double, double, double, double, double, double, double, double);
Straight straight_feed = nullptr, straight_traverse = nullptr;
template <Straight *MOVE>
void see_straight(int line, double x, double y, double z, double a, double b, double c, double u, double v, double w) {
    line = line_of(line);
    tag_move(line);
    (*MOVE)(line, x, y, z, a, b, c, u, v, w);
}

// An arc of several turns, which the naive CAM detection of G64 P Q can take for a straight move.
struct Helix {
    int line, turns;
} helix = {};
using Arc = void (*)(int, double, double, double, double, int, double, double, double, double, double, double, double);
Arc arc_feed = nullptr;

// In place of ARC_FEED.
void see_arc(int line, double end1, double end2, double axis1, double axis2, int rotation, double end3, double a,
             double b, double c, double u, double v, double w) {
    line = line_of(line);
    if (rotation > 1 || rotation < -1) {
        helix = {line, rotation < 0 ? -rotation : rotation};
    }
    tag_move(line);
    arc_feed(line, end1, end2, axis1, axis2, rotation, end3, a, b, c, u, v, w);
}

// What the interpreter is at.
struct Place {
    int line, file;
};

Place place_that_is_read() {
    return interpreter && *interpreter ? Place{(*interpreter)->sequence_number(), file_that_is_read()} : Place{};
}

// That of the tool change that comes next: the moves to [EMCIO]TOOL_CHANGE_POSITION carry the line of the move before.
Place change = {};
void (*change_tool)(int) = nullptr;

// In place of CHANGE_TOOL.
void see_change(int slot) {
    change = place_that_is_read();
    change_tool(slot);
}

// Taps and probes that motion is not asked for yet: LinuxCNC hands them on without a tag of their own.
std::deque<Place> untagged;
using Tap = void (*)(int, double, double, double, double);
Tap rigid_tap = nullptr;
using Probe = void (*)(int, double, double, double, double, double, double, double, double, double, unsigned char);
Probe straight_probe = nullptr;

// In place of RIGID_TAP.
void see_tap(int line, double x, double y, double z, double scale) {
    untagged.push_back({line, place_that_is_read().file});
    rigid_tap(line, x, y, z, scale);
}

// In place of STRAIGHT_PROBE.
void see_probe(int line, double x, double y, double z, double a, double b, double c, double u, double v, double w,
               unsigned char kind) {
    untagged.push_back({line, place_that_is_read().file});
    straight_probe(line, x, y, z, a, b, c, u, v, w, kind);
}

Place place_of(const emcmot_command_t &command) {
    if (command.command == EMCMOT_PROBE || command.command == EMCMOT_RIGID_TAP) {
        // One of no length is never asked for.
        while (untagged.size() > 1 && untagged.front().line != command.id) {
            untagged.pop_front();
        }
        const Place place = {command.id, untagged.empty() ? 0 : untagged.front().file};
        if (!untagged.empty()) {
            untagged.pop_front();
        }
        return place;
    }
    if (command.motion_type == EMC_MOTION_TYPE_TOOLCHANGE) {
        return change;
    }
    return {command.id, static_cast<int>(command.tag.fields_float[GM_FIELD_FLOAT_LINE_NUMBER])};
}

// Puts another function into the slots by which a library calls one. The executable comes first where symbols are
// looked for, so that what a preloaded library has by the same name is never found.
struct Slots {
    const char *library, *symbol;
    void *replacement;
    int found;
};

int rewrite(dl_phdr_info *info, size_t, void *asked) {
    Slots &slots = *static_cast<Slots *>(asked);
    if (!std::strstr(info->dlpi_name, slots.library)) {
        return 0;
    }
    const ElfW(Sym) *symbols = nullptr;
    const char *names = nullptr;
    const ElfW(Rela) *tables[2] = {};
    size_t sizes[2] = {};
    for (int n = 0; n < info->dlpi_phnum; n++) {
        if (info->dlpi_phdr[n].p_type != PT_DYNAMIC) {
            continue;
        }
        auto entry = reinterpret_cast<const ElfW(Dyn) *>(info->dlpi_addr + info->dlpi_phdr[n].p_vaddr);
        for (; entry->d_tag != DT_NULL; entry++) {
            switch (entry->d_tag) {
            case DT_SYMTAB: symbols = reinterpret_cast<const ElfW(Sym) *>(entry->d_un.d_ptr); break;
            case DT_STRTAB: names = reinterpret_cast<const char *>(entry->d_un.d_ptr); break;
            case DT_JMPREL: tables[0] = reinterpret_cast<const ElfW(Rela) *>(entry->d_un.d_ptr); break;
            case DT_PLTRELSZ: sizes[0] = entry->d_un.d_val; break;
            case DT_RELA: tables[1] = reinterpret_cast<const ElfW(Rela) *>(entry->d_un.d_ptr); break;
            case DT_RELASZ: sizes[1] = entry->d_un.d_val; break;
            default: break;
            }
        }
    }
    for (int t = 0; symbols && names && t < 2; t++) {
        for (size_t n = 0; tables[t] && n < sizes[t] / sizeof(ElfW(Rela)); n++) {
            const ElfW(Rela) &slot = tables[t][n];
            if (std::strcmp(names + symbols[ELF64_R_SYM(slot.r_info)].st_name, slots.symbol) != 0) {
                continue;
            }
            const size_t page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
            const size_t address = info->dlpi_addr + slot.r_offset;
            // The table is read-only once the library is loaded.
            mprotect(reinterpret_cast<void *>(address & ~(page - 1)), page, PROT_READ | PROT_WRITE);
            *reinterpret_cast<void **>(address) = slots.replacement;
            slots.found++;
        }
    }
    return 0;
}

bool replaced(const char *symbol, void *replacement) {
    Slots slots = {"librs274", symbol, replacement, 0};
    dl_iterate_phdr(rewrite, &slots);
    return slots.found > 0;
}

// ---- commands

void go_by(const emcmot_command_t &command) {
    switch (command.command) {
    case EMCMOT_SET_TERM_COND:
        stops = command.termCond == EMCMOT_TERM_COND_STOP;
        tolerance = command.tolerance;
        break;
    case EMCMOT_SET_SPINDLESYNC:
        pitch = command.spindlesync;
        is_speed = command.flags != 0;
        synched = command.spindle;
        break;
    default: break;
    }
}

record::Move::Kind kind_of(const emcmot_command_t &command) {
    using Kind = record::Move::Kind;
    if (command.command == EMCMOT_PROBE) {
        return Kind::probe;
    }
    if (command.command == EMCMOT_RIGID_TAP) {
        return Kind::tap;
    }
    return command.motion_type == EMC_MOTION_TYPE_TRAVERSE || command.motion_type == EMC_MOTION_TYPE_TOOLCHANGE
               ? Kind::rapid
               : Kind::feed;
}

void put(double *to, const EmcPose &pose) {
    const double values[] = {pose.tran.x, pose.tran.y, pose.tran.z, pose.a, pose.b, pose.c, pose.u, pose.v, pose.w};
    std::memcpy(to, values, sizeof values);
}
void put(double *to, const PmCartesian &vector) {
    to[0] = vector.x;
    to[1] = vector.y;
    to[2] = vector.z;
}

// The fastest that a spindle turns on the way to x, 1/min. G96 speeds it up towards the place that it goes by.
double fastest_turning(const spindle_status_t &spindle, double x) {
    const double most = std::fabs(spindle.speed), ends[] = {from_x - spindle.xoffset, x - spindle.xoffset};
    const double nearest = ends[0] * ends[1] > 0.0 ? std::fmin(std::fabs(ends[0]), std::fabs(ends[1])) : 0.0;
    return spindle.css_factor == 0.0 || nearest == 0.0 ? most : std::fmin(most, std::fabs(spindle.css_factor) / nearest);
}

void show_move(const emcmot_command_t &command) {
    record::Move move = {};
    const Place place = place_of(command);
    move.line = place.line;
    move.file = place.file;
    move.kind = kind_of(command);
    move.is_arc = command.command == EMCMOT_SET_CIRCLE;
    move.turns = command.turn;
    move.lost_turns = !move.is_arc && command.id == helix.line ? helix.turns : 0;
    helix = command.id == helix.line ? Helix{} : helix;
    move.tolerance = stops ? 0.0 : tolerance > 0.0 ? tolerance : INFINITY;
    const spindle_status_t &spindle = shared->status.spindle_status[0];
    // M19 stops it without an end of M3.
    move.spindle_turns = spindle.state != 0 && spindle.orient_state == EMCMOT_ORIENT_NONE;
    move.is_surface_speed = move.spindle_turns && spindle.css_factor != 0.0;
    if (move.kind != record::Move::Kind::probe && move.kind != record::Move::Kind::tap) {
        word = command.tag.fields_float[GM_FIELD_FLOAT_SPEED];
    }
    move.speed = move.spindle_turns ? std::fabs(spindle.speed) : word;
    const bool has_speed = is_speed && move.speed > 0.0 && !move.is_surface_speed;
    move.follows_spindle = (pitch != 0.0 && !has_speed) || move.kind == record::Move::Kind::tap;
    move.feed = pitch != 0.0 && has_speed ? std::fabs(pitch) * move.speed / 60.0 : command.vel;
    if (pitch != 0.0 && !is_speed && synched >= 0 && synched < EMCMOT_MAX_SPINDLES) {
        // A tap may be told to come back faster.
        const bool is_tap = move.kind == record::Move::Kind::tap;
        move.pitch = std::fabs(pitch);
        move.turning = fastest_turning(shared->status.spindle_status[synched], command.pos.tran.x) *
                       (is_tap ? std::fmax(1.0, command.scale) : 1.0);
        move.fastest = command.ini_maxvel;
    }
    from_x = command.pos.tran.x;
    put(move.end, command.pos);
    put(move.tool, shared->status.tool_offset);
    if (move.is_arc) {
        put(move.center, command.center);
        put(move.normal, command.normal);
    }
    record::move(move);
}

void look(emcmot_command_t &command) {
    go_by(command);
    switch (command.command) {
    case EMCMOT_SET_LINE:
    case EMCMOT_SET_CIRCLE:
    case EMCMOT_PROBE:
    case EMCMOT_RIGID_TAP:
        // The field comes back with the status of the move, and nothing else reads it.
        command.tag.fields[GM_FIELD_LINE_NUMBER] = record::is_on() ? ++count : 0;
        if (record::is_on()) {
            show_move(command);
        }
        break;
    case EMCMOT_SET_AXIS_POSITION_LIMITS:
    case EMCMOT_SET_JOINT_POSITION_LIMITS:
        if (is_open) {
            command.minLimit = -FAR;
            command.maxLimit = FAR;
        }
        break;
    default: break;
    }
}
}

namespace moves {
void find() {
    update = reinterpret_cast<void (*)(StateTag)>(dlsym(RTLD_DEFAULT, "_Z10UPDATE_TAG8StateTag"));
    interpreter = static_cast<InterpBase **>(dlsym(RTLD_DEFAULT, "pinterp"));
    arc_feed = reinterpret_cast<Arc>(dlsym(RTLD_DEFAULT, ARC_FEED_NAME));
    straight_feed = reinterpret_cast<Straight>(dlsym(RTLD_DEFAULT, STRAIGHT_FEED_NAME));
    straight_traverse = reinterpret_cast<Straight>(dlsym(RTLD_DEFAULT, STRAIGHT_TRAVERSE_NAME));
    queue = reinterpret_cast<const Vector &(*)()>(dlsym(RTLD_DEFAULT, "_Z2qcv"));
    change_tool = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "_Z11CHANGE_TOOLi"));
    rigid_tap = reinterpret_cast<Tap>(dlsym(RTLD_DEFAULT, "_Z9RIGID_TAPidddd"));
    straight_probe = reinterpret_cast<Probe>(dlsym(RTLD_DEFAULT, "_Z14STRAIGHT_PROBEidddddddddh"));
    const bool is_found = replaced("_Z10UPDATE_TAG8StateTag", reinterpret_cast<void *>(tag_file)) &&
                          replaced("_Z9RIGID_TAPidddd", reinterpret_cast<void *>(see_tap)) &&
                          replaced("_Z14STRAIGHT_PROBEidddddddddh", reinterpret_cast<void *>(see_probe)) &&
                          replaced(ARC_FEED_NAME, reinterpret_cast<void *>(see_arc)) &&
                          replaced(STRAIGHT_FEED_NAME, reinterpret_cast<void *>(see_straight<&straight_feed>)) &&
                          replaced(STRAIGHT_TRAVERSE_NAME, reinterpret_cast<void *>(see_straight<&straight_traverse>)) &&
                          replaced("_Z11CHANGE_TOOLi", reinterpret_cast<void *>(see_change));
    shared = static_cast<const Shared *>(memory::only());
    if (!update || !interpreter || !arc_feed || !straight_feed || !straight_traverse || !queue || !change_tool ||
        !rigid_tap || !straight_probe || !is_found || !shared) {
        give_up("this LinuxCNC hands its commands to motion in another way");
    }
}

Read reading(const char *text) {
    if (!interpreter || !*interpreter) {
        return {0, false};
    }
    // The interpreter keeps the text of its last error. The task passes on as much of it as fits into a message.
    char error[LINELEN] = "";
    (*interpreter)->error_text(INTERP_ERROR, error, sizeof error);
    const bool is_own = *text && std::strncmp(text, error, std::strlen(text)) == 0;
    return {(*interpreter)->sequence_number(), is_own};
}

void start() {
    record::Move move = {};
    for (int n = 0; n < 9; n++) {
        move.end[n] = *pins::find<double>(std::string("axis.") + "xyzabcuvw"[n] + ".pos-cmd");
    }
    put(move.tool, shared->status.tool_offset);
    record::file(environment::value("PKMKINS_VIRTUAL_PROGRAM"));
    files.push_back(environment::value("PKMKINS_VIRTUAL_PROGRAM"));
    record::move(move);
}

void cycle() {
    read_on = 0;
    if (!shared || shared->command.commandNum == last) {
        return;
    }
    emcmot_command_t &command = const_cast<emcmot_command_t &>(shared->command);
    // milltask numbers them without a gap: anything else is memory of another layout.
    if (command.commandNum != last + 1 || command.command > EMCMOT_SET_SPINDLE_PARAMS) {
        give_up("this LinuxCNC has commands of another layout");
    }
    last = command.commandNum;
    look(command);
}

void open_limits() {
    if (!is_open) {
        return;
    }
    // The limits of the module's guard, as they are where the INI file sets none.
    const std::pair<const char *, const char *> opened[] = {
        {"min-limit.*", "-1e12"}, {"max-limit.*", "1e12"}, {"tilt-limit", "0"}, {"conditioning-limit", "1e-12"},
        {"rod-clearance", "0"}, {"mechanism-clearance", "0"}, {"*-cone.*", "0"}, {"*-pyramid.*", "0"}};
    for (const char *stem : {"pkmkins.", "pkmkins.second."}) {
        for (const auto &[pattern, value] : opened) {
            std::istringstream names(pins::names_like(std::string(stem) + pattern));
            for (std::string name; names >> name;) {
                pins::set(name, value);
            }
        }
    }
}

int number() { return shared->status.tag.fields[GM_FIELD_LINE_NUMBER]; }
}
