// SPDX-License-Identifier: GPL-2.0-or-later
//
// A HAL and RTAPI without LinuxCNC: just enough of both for kinematics modules
// to be loaded, wired and called inside a test process.
//
// One process contains many modules that all need the same pin names, and cargo
// runs tests in several threads. So pins, functions and messages belong to a
// "world", and each thread selects the world for its next calls.
//
// The stub refuses what the real HAL refuses (long or repeated names, pins
// outside HAL memory, pins after hal_ready), so that a module which loads here
// also loads there. LinuxCNC's own headers are included to let the compiler
// compare every prototype.

#include "rtapi.h"
#include "hal.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define MAX_PINS 1024
#define MAX_FUNCTS 8
#define MAX_MESSAGES 256
#define MAX_BLOCKS 64
#define MESSAGE_LEN 1024
#define COMPONENT_ID 7

// A pin, or a parameter, whose value is in the module's memory.
struct pin {
    char name[HAL_NAME_LEN + 1];
    hal_type_t type;
    int dir;
    union { double f; rtapi_s32 s; rtapi_u32 u; bool b; rtapi_u64 all; } value;
    void *parameter;
};

struct funct {
    char name[HAL_NAME_LEN + 1];
    void (*call)(void *, long);
    void *arg;
};

struct message {
    int level;
    char text[MESSAGE_LEN];
};

struct block {
    char *start;
    long size;
};

struct world {
    struct pin pins[MAX_PINS];
    int pin_count;
    struct funct functs[MAX_FUNCTS];
    int funct_count;
    struct message messages[MAX_MESSAGES];
    int message_count;
    struct block blocks[MAX_BLOCKS];
    int block_count;
    unsigned long calls;
    bool initialised, ready, exited;
};

static __thread struct world *here;

// ---- functions that the tests call ------------------------------------------

EXPORT struct world *stub_world_new(void)
{
    return calloc(1, sizeof(struct world));
}

EXPORT void stub_world_free(struct world *world)
{
    for (int i = 0; i < world->block_count; i++)
        free(world->blocks[i].start);
    if (here == world)
        here = NULL;
    free(world);
}

EXPORT void stub_world_enter(struct world *world) { here = world; }

EXPORT int stub_pin_count(const struct world *world) { return world->pin_count; }
EXPORT const char *stub_pin_name(const struct world *world, int i) { return world->pins[i].name; }
EXPORT int stub_pin_type(const struct world *world, int i) { return world->pins[i].type; }
EXPORT int stub_pin_dir(const struct world *world, int i) { return world->pins[i].dir; }
EXPORT void *stub_pin_value(struct world *world, int i)
{
    struct pin *pin = &world->pins[i];
    return pin->parameter != NULL ? pin->parameter : &pin->value;
}

EXPORT int stub_message_count(const struct world *world) { return world->message_count; }
EXPORT const char *stub_message_text(const struct world *world, int i) { return world->messages[i].text; }
EXPORT int stub_message_level(const struct world *world, int i) { return world->messages[i].level; }
EXPORT void stub_messages_clear(struct world *world) { world->message_count = 0; }

EXPORT int stub_ready(const struct world *world) { return world->ready; }
EXPORT int stub_exited(const struct world *world) { return world->exited; }

// Returns the number of calls into HAL and RTAPI so far: kinematics calls must not increase it.
EXPORT unsigned long stub_calls(const struct world *world) { return world->calls; }

EXPORT int stub_funct_call(struct world *world, const char *name, long period)
{
    for (int i = 0; i < world->funct_count; i++) {
        if (strcmp(world->functs[i].name, name) == 0) {
            world->functs[i].call(world->functs[i].arg, period);
            return 0;
        }
    }
    return -ENOENT;
}

// ---- HAL -------------------------------------------------------------------

static int refuse(int code, const char *what, const char *name)
{
    rtapi_print_msg(RTAPI_MSG_ERR, "stub HAL: %s: '%s'", what, name);
    return code;
}

static bool name_is_bad(const char *name)
{
    return name == NULL || name[0] == '\0' || strlen(name) > HAL_NAME_LEN;
}

static bool in_hal_memory(const void *address, size_t size)
{
    const char *p = address;
    for (int i = 0; i < here->block_count; i++) {
        const struct block *block = &here->blocks[i];
        if (p >= block->start && p + size <= block->start + block->size)
            return true;
    }
    return false;
}

EXPORT int hal_init(const char *name)
{
    here->calls++;
    if (name_is_bad(name))
        return refuse(-EINVAL, "bad component name", name ? name : "(null)");
    if (here->initialised)
        return refuse(-EBUSY, "second hal_init", name);
    here->initialised = true;
    return COMPONENT_ID;
}

EXPORT int hal_ready(int comp_id)
{
    here->calls++;
    if (comp_id != COMPONENT_ID || here->ready)
        return refuse(-EINVAL, "hal_ready", "component");
    here->ready = true;
    return 0;
}

EXPORT int hal_exit(int comp_id)
{
    here->calls++;
    if (comp_id != COMPONENT_ID)
        return refuse(-EINVAL, "hal_exit", "component");
    here->exited = true;
    return 0;
}

EXPORT void *hal_malloc(long size)
{
    here->calls++;
    if (size <= 0 || here->block_count == MAX_BLOCKS)
        return NULL;
    struct block *block = &here->blocks[here->block_count];
    block->start = calloc(1, (size_t)size);
    if (block->start == NULL)
        return NULL;
    block->size = size;
    here->block_count++;
    return block->start;
}

// Adds an entry to the list of pins; returns NULL, with a message, if the name is taken.
static struct pin *new_pin(const char *name, hal_type_t type, int dir)
{
    for (int i = 0; i < here->pin_count; i++) {
        if (strcmp(here->pins[i].name, name) == 0) {
            refuse(-EINVAL, "name taken", name);
            return NULL;
        }
    }
    if (here->pin_count == MAX_PINS) {
        refuse(-ENOMEM, "too many pins", name);
        return NULL;
    }
    struct pin *pin = &here->pins[here->pin_count++];
    strcpy(pin->name, name);
    pin->type = type;
    pin->dir = dir;
    return pin;
}

EXPORT int hal_pin_new(const char *name, hal_type_t type, hal_pin_dir_t dir,
                       void **data_ptr_addr, int comp_id)
{
    here->calls++;
    if (name_is_bad(name))
        return refuse(-EINVAL, "bad pin name", name ? name : "(null)");
    if (comp_id != COMPONENT_ID || here->ready)
        return refuse(-EINVAL, "pin of no component, or after hal_ready", name);
    if (dir != HAL_IN && dir != HAL_OUT && dir != HAL_IO)
        return refuse(-EINVAL, "bad pin direction", name);
    if (!in_hal_memory(data_ptr_addr, sizeof *data_ptr_addr))
        return refuse(-EINVAL, "pin pointer outside HAL memory", name);
    struct pin *pin = new_pin(name, type, dir);
    if (pin == NULL)
        return -EINVAL;
    *data_ptr_addr = &pin->value;
    return 0;
}

// The only form of parameter that a module of LinuxCNC uses here (pentakins).
EXPORT int hal_param_float_newf(hal_param_dir_t dir, hal_float_t *data_addr, int comp_id,
                                const char *fmt, ...)
{
    char name[2 * HAL_NAME_LEN];
    va_list args;
    va_start(args, fmt);
    vsnprintf(name, sizeof name, fmt, args);
    va_end(args);
    here->calls++;
    if (name_is_bad(name) || comp_id != COMPONENT_ID || here->ready)
        return refuse(-EINVAL, "parameter refused", name);
    if (dir != HAL_RO && dir != HAL_RW)
        return refuse(-EINVAL, "bad parameter direction", name);
    if (!in_hal_memory((const void *)data_addr, sizeof *data_addr))
        return refuse(-EINVAL, "parameter outside HAL memory", name);
    struct pin *pin = new_pin(name, HAL_FLOAT, dir);
    if (pin == NULL)
        return -EINVAL;
    pin->parameter = (void *)data_addr;
    return 0;
}

// Both forms of the four typed constructors, as hal.h declares them.
#define PIN_CONSTRUCTORS(kind, KIND)                                              \
    EXPORT int hal_pin_##kind##_new(const char *name, hal_pin_dir_t dir,          \
                                    hal_##kind##_t **data_ptr_addr, int comp_id)  \
    {                                                                             \
        return hal_pin_new(name, HAL_##KIND, dir, (void **)data_ptr_addr, comp_id); \
    }                                                                             \
    EXPORT int hal_pin_##kind##_newf(hal_pin_dir_t dir,                           \
                                     hal_##kind##_t **data_ptr_addr, int comp_id, \
                                     const char *fmt, ...)                        \
    {                                                                             \
        char name[2 * HAL_NAME_LEN];                                              \
        va_list args;                                                             \
        va_start(args, fmt);                                                      \
        vsnprintf(name, sizeof name, fmt, args);                                  \
        va_end(args);                                                             \
        return hal_pin_new(name, HAL_##KIND, dir, (void **)data_ptr_addr, comp_id); \
    }

PIN_CONSTRUCTORS(bit, BIT)
PIN_CONSTRUCTORS(float, FLOAT)
PIN_CONSTRUCTORS(u32, U32)
PIN_CONSTRUCTORS(s32, S32)

// The constructors of LinuxCNC 2.10, even with the header of an older version: the stub supports modules for
// either HAL.
#ifndef HAL_REAL
typedef struct stub_reference *hal_bool_t, *hal_real_t, *hal_sint_t, *hal_uint_t;
typedef hal_pin_dir_t hal_pdir_t;
#endif

#define REFERENCE_CONSTRUCTOR(kind, reference, value_type, KIND, write)                    \
    EXPORT int hal_pin_new_##kind(int comp_id, hal_pdir_t dir, reference *pin,             \
                                  value_type value, const char *fmt, ...)                  \
    {                                                                                      \
        char name[2 * HAL_NAME_LEN];                                                       \
        va_list args;                                                                      \
        va_start(args, fmt);                                                               \
        vsnprintf(name, sizeof name, fmt, args);                                           \
        va_end(args);                                                                      \
        int code = hal_pin_new(name, HAL_##KIND, (hal_pin_dir_t)dir, (void **)pin, comp_id); \
        if (code == 0)                                                                     \
            write;                                                                         \
        return code;                                                                       \
    }

REFERENCE_CONSTRUCTOR(bool, hal_bool_t, bool, BIT, *(rtapi_u64 *)*pin = value)
REFERENCE_CONSTRUCTOR(real, hal_real_t, double, FLOAT, *(double *)*pin = value)
REFERENCE_CONSTRUCTOR(ui32, hal_uint_t, rtapi_u32, U32, *(rtapi_u64 *)*pin = value)
REFERENCE_CONSTRUCTOR(si32, hal_sint_t, rtapi_s32, S32, *(rtapi_s64 *)*pin = value)

EXPORT int hal_export_funct(const char *name, void (*funct)(void *, long), void *arg,
                            int uses_fp, int reentrant, int comp_id)
{
    (void)uses_fp;
    (void)reentrant;
    here->calls++;
    if (name_is_bad(name) || funct == NULL)
        return refuse(-EINVAL, "bad function", name ? name : "(null)");
    if (comp_id != COMPONENT_ID || here->ready || here->funct_count == MAX_FUNCTS)
        return refuse(-EINVAL, "function refused", name);
    if (arg != NULL && !in_hal_memory(arg, 1))
        return refuse(-EINVAL, "function argument outside HAL memory", name);
    struct funct *entry = &here->functs[here->funct_count++];
    strcpy(entry->name, name);
    entry->call = funct;
    entry->arg = arg;
    return 0;
}

// ---- RTAPI -----------------------------------------------------------------

static void keep_message(int level, const char *fmt, va_list args)
{
    here->calls++;
    if (here->message_count == MAX_MESSAGES)
        return;
    struct message *message = &here->messages[here->message_count++];
    message->level = level;
    vsnprintf(message->text, sizeof message->text, fmt, args);
}

EXPORT void rtapi_print(const char *fmt, ...)
{
    va_list args;
    va_start(args, fmt);
    keep_message(RTAPI_MSG_ALL, fmt, args);
    va_end(args);
}

// Counts its calls: a clock that advances, identically in every run.
static _Thread_local long long int now;

EXPORT long long int rtapi_get_time(void)
{
    return ++now;
}

EXPORT void stub_pass_time(long long int nanoseconds)
{
    now += nanoseconds;
}

EXPORT void rtapi_print_msg(msg_level_t level, const char *fmt, ...)
{
    va_list args;
    va_start(args, fmt);
    keep_message(level, fmt, args);
    va_end(args);
}
