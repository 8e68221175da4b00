// SPDX-License-Identifier: GPL-2.0-or-later
//
// Compares the module's access to its pins with LinuxCNC's own header: the module reads the values that the header's
// accessors write, and vice versa. The accessors are the inline getters and setters
// of 2.10, or the typed pointers of 2.9.
//
// Before a write all 64 bits of the pin are set, to detect an access of another width.

#include "rtapi.h"
#include "hal.h"
#include "emcpos.h"
#include "kinematics.h"

#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef HAL_REAL
#define CONSTRUCTOR "hal_pin_new_real"
#define READ(type, at) hal_get_##type((void *)(at))
#define WRITE(type, at, value) hal_set_##type((void *)(at), value)
// Reading all 64 bits gives the same number.
#define WHOLE_si32(at) hal_get_sint((void *)(at))
#define WHOLE_ui32(at) hal_get_uint((void *)(at))
#else
#define CONSTRUCTOR "hal_pin_float_new"
typedef hal_float_t real_pin;
typedef hal_bit_t bool_pin;
typedef hal_s32_t si32_pin;
typedef hal_u32_t ui32_pin;
#define READ(type, at) (*(type##_pin *)(at))
#define WRITE(type, at, value) (*(type##_pin *)(at) = (value))
#define WHOLE_si32(at) READ(si32, at)
#define WHOLE_ui32(at) READ(ui32, at)
#endif

static void *stub, *library, *world;

static void *find(void *in, const char *name)
{
    void *address = dlsym(in, name);
    if (address == NULL) {
        fprintf(stderr, "no %s\n", name);
        exit(2);
    }
    return address;
}

static void *pin(const char *name)
{
    int (*count)(const void *) = (int (*)(const void *))find(stub, "stub_pin_count");
    const char *(*name_of)(const void *, int) =
        (const char *(*)(const void *, int))find(stub, "stub_pin_name");
    void *(*value)(void *, int) = (void *(*)(void *, int))find(stub, "stub_pin_value");
    for (int i = 0; i < count(world); i++)
        if (strcmp(name_of(world, i), name) == 0)
            return value(world, i);
    fprintf(stderr, "no pin %s\n", name);
    exit(2);
}

static int check(int good, const char *what)
{
    printf("%s: %s\n", good ? "ok" : "FAILED", what);
    return good ? 0 : 1;
}

static void monitor(void)
{
    int (*run)(void *, const char *, long) =
        (int (*)(void *, const char *, long))find(stub, "stub_funct_call");
    run(world, "pkmkins.monitor", 1000000);
}

static void *dirty(const char *name)
{
    return memset(pin(name), 0xff, sizeof(double));
}

// Checks the first values, which the module or HAL has written.
static int defaults(void)
{
    int bad = check(READ(real, pin("pkmkins.max-error")) == 500.0, "first value of a float");
    bad += check(READ(bool, pin("kinstype.is-0")), "first value of a bit that is on");
    bad += check(!READ(bool, pin("kinstype.is-1")), "first value of a bit that is off");
    bad += check(WHOLE_ui32(pin("pkmkins.limit-iterations")) == 120, "first value of a u32");
    bad += check(WHOLE_si32(pin("pkmkins.fault-leg")) == -1, "first value of an s32");
    return bad;
}

// Checks by the module's behavior that it reads the values that the header writes.
static int reads(void)
{
    int (*inverse)(const EmcPose *, double *, const unsigned long *, unsigned long *) =
        (int (*)(const EmcPose *, double *, const unsigned long *, unsigned long *))find(
            library, "kinematicsInverse");
    int (*forward)(const double *, EmcPose *, const unsigned long *, unsigned long *) =
        (int (*)(const double *, EmcPose *, const unsigned long *, unsigned long *))find(
            library, "kinematicsForward");
    const EmcPose pose = {{0.5, -0.25, 20.0}, 1.0, -2.0, 3.0, 0, 0, 0};
    EmcPose near = pose;
    double joints[16] = {0};

    WRITE(bool, dirty("pkmkins.apply"), 0);
    monitor();
    int bad = check(!READ(bool, pin("pkmkins.geometry-ok")), "a bit that is off is read as off");
    WRITE(real, dirty("pkmkins.tool-offset-x"), 1.5);
    WRITE(bool, dirty("pkmkins.apply"), 1);
    monitor();
    bad += check(READ(bool, pin("pkmkins.geometry-ok")), "a bit that is on is read as on");
    bad += check(READ(real, pin("pkmkins.tool-offset-eff-x")) == 1.5, "a float is read");

    bad += check(inverse(&pose, joints, NULL, NULL) == 0, "inverse");
    near.tran.x += 0.3;
    WRITE(ui32, dirty("pkmkins.limit-iterations"), 0);
    bad += check(forward(joints, &near, NULL, NULL) < 0, "a u32 of 0 is read: no iteration is left");
    near = pose;
    near.tran.x += 0.3;
    WRITE(ui32, dirty("pkmkins.limit-iterations"), 120);
    bad += check(forward(joints, &near, NULL, NULL) == 0, "a u32 of 120 is read");
    return bad;
}

// Runs the cycles over which the module spreads updates for users.
static void show_all(void)
{
    for (int cycle = 0; cycle < 100; cycle++)
        monitor();
}

// Checks that the header reads the values that the module writes. The module reads no s32 pin.
static int writes(void)
{
    dirty("pkmkins.fault-leg");
    dirty("pkmkins.fault");
    dirty("pkmkins.fwd-kins-fail");
    dirty("pkmkins.geometry-changed");
    int (*swap)(int) = (int (*)(int))find(library, "kinematicsSwitch");
    int code = swap(7);
    show_all();
    int bad = check(code < 0 && WHOLE_si32(pin("pkmkins.fault")) == code, "an s32 below 0 is written");
    bad += check(WHOLE_si32(pin("pkmkins.fault-leg")) == -1, "an s32 of -1 is written");
    bad += check(!READ(bool, pin("pkmkins.geometry-changed")), "a bit that is off is written");
    WRITE(bool, dirty("pkmkins.fault-reset"), 0);
    monitor();
    WRITE(bool, dirty("pkmkins.fault-reset"), 1);
    monitor();
    bad += check(WHOLE_si32(pin("pkmkins.fault")) == 0, "an s32 of 0 is written");
    WRITE(ui32, dirty("pkmkins.fault-count"), 4294967295u);
    swap(7);
    bad += check(WHOLE_ui32(pin("pkmkins.fault-count")) == 0, "a u32 is written, and turns over");
    swap(7);
    bad += check(WHOLE_ui32(pin("pkmkins.fault-count")) == 1, "a u32 counts on");
    WRITE(real, dirty("pkmkins.base.0.x"), 0.25);
    show_all();
    bad += check(READ(bool, pin("pkmkins.geometry-changed")), "a bit that is on is written");
    return bad;
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: %s STUB_HAL MODULE\n", argv[0]);
        return 2;
    }
    stub = dlopen(argv[1], RTLD_NOW | RTLD_GLOBAL);
    if (stub != NULL)
        library = dlopen(argv[2], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    world = ((void *(*)(void))find(stub, "stub_world_new"))();
    ((void (*)(void *))find(stub, "stub_world_enter"))(world);
    int bad = check(((int (*)(void))find(library, "rtapi_app_main"))() == 0, "rtapi_app_main");
    bad += defaults() + reads() + writes();
    ((void (*)(void))find(library, "rtapi_app_exit"))();
    ((void (*)(void *))find(stub, "stub_world_free"))(world);
    printf("ok: pins as those of %s\n", CONSTRUCTOR);
    return bad != 0;
}
