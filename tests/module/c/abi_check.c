// SPDX-License-Identifier: GPL-2.0-or-later
//
// Compares pkmkins.h with LinuxCNC's own headers, and the built module with both.
//
// The first half is for the compiler: with LinuxCNC's kinematics.h in the same
// unit every prototype of pkmkins.h is a repeated declaration, and a difference
// is an error. With -DALONE the unit has only pkmkins.h, and the
// same sizes and offsets must hold for the types that it defines.
//
// The second half runs: a C program loads the module as rtapi_app does and
// calls it through the prototypes.

#ifndef ALONE
#include "emcpos.h"
#include "kinematics.h"
#endif
#include "pkmkins.h"

#include <dlfcn.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define AT(type, member, number) \
    _Static_assert(offsetof(type, member) == (number) * sizeof(double), #type "." #member)

_Static_assert(sizeof(double) == 8, "double");
_Static_assert(sizeof(EmcPose) == 9 * sizeof(double), "EmcPose");
AT(EmcPose, tran.x, 0);
AT(EmcPose, tran.y, 1);
AT(EmcPose, tran.z, 2);
AT(EmcPose, a, 3);
AT(EmcPose, b, 4);
AT(EmcPose, c, 5);
AT(EmcPose, u, 6);
AT(EmcPose, v, 7);
AT(EmcPose, w, 8);
_Static_assert(sizeof(PmCartesian) == 3 * sizeof(double), "PmCartesian");
_Static_assert(sizeof(PmRotationMatrix) == 9 * sizeof(double), "PmRotationMatrix");
AT(PmRotationMatrix, x.x, 0);
AT(PmRotationMatrix, x.z, 2);
AT(PmRotationMatrix, y.x, 3);
AT(PmRotationMatrix, z.x, 6);
AT(PmRotationMatrix, z.z, 8);
_Static_assert(KINEMATICS_BOTH == 4, "KINEMATICS_BOTH");
_Static_assert(sizeof(KINEMATICS_TYPE) == sizeof(int), "KINEMATICS_TYPE");
_Static_assert(sizeof(KINEMATICS_FORWARD_FLAGS) == sizeof(unsigned long), "forward flags");
_Static_assert(sizeof(KINEMATICS_INVERSE_FLAGS) == sizeof(unsigned long), "inverse flags");

// The functions that LinuxCNC calls, declared again here: these are compared even if
// its headers are absent, including those that its 2.9 headers do not have yet.
extern int kinematicsForward(const double *joint, struct EmcPose *world,
                             const KINEMATICS_FORWARD_FLAGS *fflags,
                             KINEMATICS_INVERSE_FLAGS *iflags);
extern int kinematicsInverse(const struct EmcPose *world, double *joint,
                             const KINEMATICS_INVERSE_FLAGS *iflags,
                             KINEMATICS_FORWARD_FLAGS *fflags);
extern KINEMATICS_TYPE kinematicsType(void);
extern int kinematicsSwitchable(void);
extern int kinematicsSwitch(int switchkins_type);
extern int kinematicsJacobian(const double *joint, const EmcPose *world, double (*jac)[9],
                              const KINEMATICS_INVERSE_FLAGS *iflags);
extern int kinematicsToolFrame(const double *joint, PmRotationMatrix *rot,
                               const KINEMATICS_FORWARD_FLAGS *fflags);
extern int kinematicsWorkFrame(const double *joint, PmRotationMatrix *rot,
                               const KINEMATICS_FORWARD_FLAGS *fflags);
extern int kinematicsToolFrameInverse(const PmCartesian *axis_in_work, const PmCartesian *x_in_work,
                                      const double *seed, unsigned int held, double *solutions,
                                      int max_solutions, int *free_directions, double *tool_spin);
extern int kinematicsTypeFlags(int ktype);
extern int kinematicsSetTool(const EmcPose *tool);

// run.sh plants one mismatch at a time here and expects a compiler error.
#ifdef PLANT
PLANT;
#endif

static void *library;

static void *find(const char *name)
{
    void *address = dlsym(library, name);
    if (address == NULL) {
        fprintf(stderr, "the module exports no %s\n", name);
        exit(1);
    }
    return address;
}

#define CALL(name) ((__typeof__(&name))find(#name))

static int check(int good, const char *what)
{
    printf("%s: %s\n", good ? "ok" : "FAILED", what);
    return good ? 0 : 1;
}

static int round_trip(void)
{
    const KINEMATICS_INVERSE_FLAGS iflags = 0;
    const KINEMATICS_FORWARD_FLAGS fflags = 0;
    KINEMATICS_FORWARD_FLAGS new_fflags = 0;
    KINEMATICS_INVERSE_FLAGS new_iflags = 0;
    // A pose of the default geometry, with different components.
    EmcPose pose = {{0.5, -0.25, 20.0}, 1.0, -2.0, 3.0, 4.0, 5.0, 6.0};
    EmcPose found = pose;
    double joints[16] = {0}, jacobian[16][9] = {{0}};
    PmRotationMatrix rot;
    memset(&rot, 0, sizeof rot);

    int bad = check(CALL(kinematicsInverse)(&pose, joints, &iflags, &new_fflags) == 0, "inverse");
    found.tran.x += 0.01;
    bad += check(CALL(kinematicsForward)(joints, &found, &fflags, &new_iflags) == 0, "forward");
    bad += check(fabs(found.tran.x - pose.tran.x) < 1e-9 && fabs(found.tran.z - pose.tran.z) < 1e-9
                     && fabs(found.a - pose.a) < 1e-8 && fabs(found.b - pose.b) < 1e-8
                     && fabs(found.c - pose.c) < 1e-8,
                 "forward returns the pose, member by member");
    bad += check(found.u == 4.0 && found.v == 5.0 && found.w == 6.0, "u, v, w are left alone");
    bad += check(CALL(kinematicsJacobian)(joints, &pose, jacobian, &iflags) == 0, "jacobian");
    bad += check(jacobian[5][2] > 0.5 && jacobian[6][0] == 0.0, "jac[joint][component]");
    bad += check(CALL(kinematicsToolFrame)(joints, &rot, &fflags) == 0, "tool frame");
    bad += check(rot.z.z > 0.99 && fabs(rot.x.y - sin(3.0 * M_PI / 180)) < 1e-2,
                 "columns of the tool frame");
    bad += check(CALL(kinematicsWorkFrame)(joints, &rot, &fflags) == 0, "work frame");
    return bad;
}

static int refuses_null(void)
{
    const KINEMATICS_INVERSE_FLAGS flags = 0;
    KINEMATICS_FORWARD_FLAGS new_flags = 0;
    double joints[16] = {0};
    EmcPose pose = {{0.0, 0.0, 20.0}, 0, 0, 0, 0, 0, 0};
    int bad = check(CALL(kinematicsInverse)(NULL, joints, &flags, &new_flags) < 0, "null pose");
    bad += check(CALL(kinematicsInverse)(&pose, NULL, &flags, &new_flags) < 0, "null joints");
    EmcPose lost = pose;
    bad += check(CALL(kinematicsForward)(NULL, &lost, &flags, &new_flags) < 0, "null joints");
    bad += check(isnan(lost.tran.x) && isnan(lost.c) && lost.u == 0.0, "null joints leave no pose");
    bad += check(CALL(kinematicsForward)(joints, NULL, &flags, &new_flags) < 0, "null pose");
    bad += check(CALL(kinematicsInverse)(&pose, joints, NULL, NULL) == 0, "flags are optional");
    return bad;
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: %s STUB_HAL MODULE\n", argv[0]);
        return 2;
    }
    void *stub = dlopen(argv[1], RTLD_NOW | RTLD_GLOBAL);
    if (stub != NULL)
        library = dlopen(argv[2], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    void *(*world_new)(void) = (void *(*)(void))dlsym(stub, "stub_world_new");
    void (*world_enter)(void *) = (void (*)(void *))dlsym(stub, "stub_world_enter");
    void (*world_free)(void *) = (void (*)(void *))dlsym(stub, "stub_world_free");
    void *world = world_new();
    world_enter(world);
    int (*start)(void) = (int (*)(void))find("rtapi_app_main");
    void (*stop)(void) = (void (*)(void))find("rtapi_app_exit");
    int bad = check(start() == 0, "rtapi_app_main");
    bad += check(CALL(kinematicsType)() == KINEMATICS_BOTH, "kinematicsType");
    bad += check(CALL(kinematicsSwitchable)() == 1, "kinematicsSwitchable");
    bad += round_trip();
    bad += refuses_null();
    bad += check(CALL(kinematicsTypeFlags)(0) == 2 && CALL(kinematicsTypeFlags)(1) == 1
                     && CALL(kinematicsTypeFlags)(2) == -1,
                 "kinematicsTypeFlags");
    const EmcPose tool = {{1.0, 2.0, 3.0}, 0, 0, 0, 0, 0, 0};
    bad += check(CALL(kinematicsSetTool)(&tool) == 0 && CALL(kinematicsSetTool)(NULL) == -1,
                 "kinematicsSetTool");
    bad += check(CALL(kinematicsSwitch)(1) == 0, "kinematicsSwitch");
    stop();
    world_free(world);
    return bad != 0;
}
