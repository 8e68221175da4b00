// SPDX-License-Identifier: GPL-2.0-or-later
// A milltask as far as the library for virtual time measures it, with the interface of 2.10. FAULT names the field
// that is different; WITHOUT_TAG leaves out a function.

#include <dlfcn.h>

#include <cstdlib>
#include <cstring>

class CMS;
class RCS_STAT_CHANNEL {
  public:
    RCS_STAT_CHANNEL(int (*)(int, void *, CMS *), const char *, const char *, const char *, int);
};
RCS_STAT_CHANNEL::RCS_STAT_CHANNEL(int (*)(int, void *, CMS *), const char *, const char *, const char *, int) {}
class NML {
  public:
    int valid();
};
int NML::valid() { return 1; }
class Task {
  public:
    int iocontrol_hal_init();
};
int Task::iocontrol_hal_init() { return 0; }

struct EmcPose {
    double values[9];
};
struct PM_CARTESIAN {
    double x, y, z;
};
struct state_tag_t {
    double fields_float[11];
    int fields[8];
    unsigned long packed_flags;
    char filename[256];
};
struct StateTag : state_tag_t {
    unsigned long flags;
};

namespace {
enum Code { LINE = 30, CIRCLE, PROBE, TAP, CONDITION, SYNC, JOINT, AXIS, START, ORIENT, SPINDLE };
struct Command {
    int code, number;
    EmcPose pos;
    PM_CARTESIAN center, normal;
    int turn;
    double vel, ini_maxvel, acc;
    int motion_type;
    double spindlesync;
    int id, condition;
    double tolerance;
    unsigned char flags;
    int spindle;
    double low, high, scale, added;
    state_tag_t tag;
};
struct Spindle {
    double speed, scale, net_scale, css_factor, xoffset;
    int state, direction, brake, locked, orient_fault, orient_state;
    double min_neg_speed;
};
struct Shared {
    long mutex;
    Command command;
    double before[4];
    Spindle spindles[2];
};
Command command;
state_tag_t tag;
Shared *shared;
int number;

bool is(const char *fault) {
    const char *named = getenv("FAULT");
    return named && !std::strcmp(named, fault);
}
template <typename Call> Call call(const char *name) { return reinterpret_cast<Call>(dlsym(RTLD_DEFAULT, name)); }

int write(Code code) {
    command.code = is("code") && code == CIRCLE ? LINE : code;
    command.number = is("number") ? 0 : ++number;
    shared->command = command;
    if (is("vel")) {
        shared->command.added = command.vel;
    }
    if (is("ini_maxvel")) {
        const float narrow = static_cast<float>(command.ini_maxvel);
        std::memset(&shared->command.ini_maxvel, 0, sizeof(double));
        std::memcpy(&shared->command.ini_maxvel, &narrow, sizeof narrow);
    }
    if (is("pos")) {
        shared->command.pos.values[1] = command.pos.values[2];
        shared->command.pos.values[2] = command.pos.values[1];
    }
    return -1;
}

void handle(void *, long) {
    const Command &from = shared->command;
    if (from.spindle >= 2) {
        return;
    }
    Spindle &spindle = shared->spindles[from.spindle];
    switch (from.code) {
    case SPINDLE: spindle.min_neg_speed = is("limit") ? 0.0 : from.low; break;
    case START:
        spindle.speed = from.vel < spindle.min_neg_speed ? spindle.min_neg_speed : from.vel;
        spindle.css_factor = from.ini_maxvel;
        spindle.xoffset = is("xoffset") ? 0.0 : from.acc;
        spindle.scale = is("css_factor") ? from.ini_maxvel : 1.0;
        spindle.state = is("state") ? 2 : 1;
        spindle.direction = -1;
        spindle.orient_state = 0;
        break;
    case ORIENT:
        spindle.speed = 0.0;
        spindle.direction = 0;
        spindle.orient_state = 2;
        spindle.locked = is("orient_state") ? 2 : 0;
        break;
    default: break;
    }
}
}

int usrmotInit(const char *) {
    call<int (*)(int, int, unsigned long)>("rtapi_shmem_new")(100, 1, sizeof(Shared));
    call<int (*)(int, void **)>("rtapi_shmem_getptr")(100, reinterpret_cast<void **>(&shared));
    call<int (*)(const char *, void (*)(void *, long), void *, int, int, int)>("hal_export_funct")(
        "motion-command-handler", handle, nullptr, 1, 0, 1);
    return 0;
}
int emcTrajSetMotionId(int id) {
    command.id = id;
    return 0;
}
int emcTrajSetAxes(int) { return 0; }
#ifndef WITHOUT_TAG
int emcTrajUpdateTag(StateTag const &given) {
    tag = given;
    (is("tag") ? reinterpret_cast<unsigned long &>(tag.fields_float[10]) : tag.packed_flags) = given.flags;
    return 0;
}
#endif
int emcTrajLinearMove(const EmcPose &end, int type, double vel, double ini_maxvel, double acc, double, int turn) {
    command.pos = end;
    command.motion_type = type;
    command.vel = vel;
    command.ini_maxvel = ini_maxvel;
    command.acc = acc;
    command.turn = turn;
    command.tag = tag;
    return write(LINE);
}
int emcTrajCircularMove(const EmcPose &end, const PM_CARTESIAN &center, const PM_CARTESIAN &normal, int turn, int type,
                        double, double, double, double) {
    command.pos = end;
    command.center = center;
    command.normal = normal;
    command.turn = turn;
    command.motion_type = type;
    return write(CIRCLE);
}
int emcTrajProbe(const EmcPose &end, int, double, double, double, double, unsigned char) {
    command.pos = end;
    return write(PROBE);
}
int emcTrajRigidTap(const EmcPose &end, double, double, double, double, double scale) {
    command.pos = end;
    command.scale = scale;
    return write(TAP);
}
int emcTrajSetTermCond(int condition, double tolerance) {
    command.condition = condition;
    command.tolerance = tolerance;
    return write(CONDITION);
}
int emcTrajSetSpindleSync(int spindle, double pitch, bool waits) {
    command.spindle = spindle;
    command.spindlesync = pitch;
    command.flags = waits;
    return write(SYNC);
}
int emcJointSetMinPositionLimit(int, double limit) {
    command.low = limit;
    return write(JOINT);
}
int emcJointSetMaxPositionLimit(int, double limit) {
    command.high = limit;
    return write(JOINT);
}
int emcAxisSetMinPositionLimit(int, double limit) {
    (is("minLimit") ? command.added : command.low) = limit;
    return write(AXIS);
}
int emcAxisSetMaxPositionLimit(int, double limit) {
    command.high = limit;
    return write(AXIS);
}
int emcSpindleOn(int spindle, double speed, double factor, double offset, int) {
    command.spindle = spindle;
    command.vel = speed;
    command.ini_maxvel = factor;
    command.acc = offset;
    return write(START);
}
int emcSpindleOrient(int spindle, double, int) {
    command.spindle = spindle;
    return write(ORIENT);
}
int emcSpindleSetParams(int spindle, double, double, double, double min_neg, double, double, int, double) {
    command.spindle = spindle;
    command.low = min_neg;
    return write(SPINDLE);
}

int main() {}
