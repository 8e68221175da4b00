// SPDX-License-Identifier: GPL-2.0-or-later
//
// A library that satisfies its contract (contract.toml beside it), unless one of the faults
// below is planted with -D and its name.

#include <stdarg.h>

// The functions of the HAL that the contract names.
void print(const char *text);
void make_pin(const char *name);

void *malloc(unsigned long);
void abort(void) __attribute__((noreturn));

#define EXPORT __attribute__((visibility("default")))
#define APART __attribute__((noinline))

static volatile double kept;

#ifdef RECURSION
static APART double again(double x)
{
    kept = x;
    return x > 1.0 ? again(x / 2.0) + kept : x;
}
#endif

#ifdef POINTER_CALL
EXPORT double (*given)(double);
#endif

#ifdef BIG_FRAME
static APART double many(double x)
{
    volatile double values[5000];
    for (int i = 0; i < 5000; i++)
        values[i] = x * i;
    return values[17];
}
#endif

#ifdef GROWING_FRAME
static APART double some(double x)
{
    volatile double values[(int)x];
    values[0] = x;
    return values[(int)x - 1];
}
#endif

static APART double square(double x)
{
    kept = x;
    return x * x;
}

// Enough cases for a jump table.
static APART const char *word(int number)
{
    switch (number) {
    case 0: print("zero"); return "a";
    case 1: print("one"); return "b";
    case 2: kept = 2.0; return "c";
    case 3: kept = 3.5; return "d";
    case 4: print("four"); kept = 7.0; return "e";
    case 5: kept = kept + 1.0; return "f";
    default: return "g";
    }
}

EXPORT double run(double x)
{
    // A frame of some pages, which a compiler may open page by page.
    volatile double values[1000];
    for (int i = 0; i < 1000; i++)
        values[i] = square(x + i);
    print(word((int)x));
#ifdef RECURSION
    x += again(x);
#endif
#ifdef POINTER_CALL
    x += given(x);
#endif
#ifdef BIG_FRAME
    x += many(x);
#endif
#ifdef GROWING_FRAME
    x += some(x);
#endif
#ifdef IMPORT_MALLOC
    *(double *)malloc(8) = x;
#endif
#ifdef IMPORT_ABORT
    if (x < 0.0)
        abort();
#endif
#ifdef PIN_AT_RUN
    make_pin("late");
#endif
#ifdef TRAP
    if (x < 0.0)
        __builtin_trap();
#endif
#ifdef SYSTEM_CALL
    long result;
    __asm__ volatile("syscall" : "=a"(result) : "a"(39) : "rcx", "r11", "memory");
    x += result;
#endif
    return x + values[3];
}

EXPORT int start(void)
{
    make_pin("early");
    return 0;
}

#ifdef EXTRA_EXPORT
EXPORT double also(double x) { return x; }
#endif

#ifdef HANDED_OUT
void hand_over(double (*function)(double));
EXPORT double (*const handed)(double) = square;
#endif

#ifdef TEXT_RELOCATION
__asm__(".text\n.balign 8\n.quad start\n");
#endif
