/* The example on QEMU's mps2-an386 (Cortex-M4F) and mps2-an385 (Cortex-M3), without a C library: vectors, start-up, and output
 * by semihosting. 16 MiB of memory at 0x21000000 stand for memory-mapped flash. */
#include "example.h"
#include <stdint.h>

extern uint32_t stack_end, data_start, data_end, data_load, bss_start, bss_end;

static int semihosting(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

/* To standard output of QEMU: its console, opened at the first use. */
void print(const char *text)
{
    static int handle = -1;
    if (handle < 0) {
        static const char name[] = ":tt";
        const uint32_t open[3] = {(uint32_t)name, 4 /* for writing */, sizeof name - 1};
        handle = semihosting(0x01, open); /* SYS_OPEN */
    }
    uint32_t length = 0;
    while (text[length] != 0) {
        length++;
    }
    const uint32_t write[3] = {(uint32_t)handle, (uint32_t)text, length};
    semihosting(0x05, write); /* SYS_WRITE */
}

const void *flash(size_t *length)
{
    *length = 16u << 20;
    return (const void *)0x21000000;
}

__attribute__((noreturn)) static void leave(uint32_t status)
{
    const uint32_t reason[2] = {0x20026 /* the application ended */, status};
    for (;;) {
        semihosting(0x20, reason); /* SYS_EXIT_EXTENDED */
    }
}

__attribute__((noreturn)) static void fault(void)
{
    print("fault\n");
    leave(3);
}

__attribute__((noreturn)) static void reset(void)
{
#ifdef __ARM_FP
    /* CPACR: full access to the FPU, before anything can use it. */
    *(volatile uint32_t *)0xe000ed88 |= 0xfu << 20;
    __asm__ volatile("dsb\n\tisb" : : : "memory");
#endif
    for (uint32_t *to = &data_start, *from = &data_load; to < &data_end;) {
        *to++ = *from++;
    }
    for (uint32_t *to = &bss_start; to < &bss_end;) {
        *to++ = 0;
    }
    leave((uint32_t)example());
}

struct vectors {
    const void *stack;
    void (*handlers[15])(void);
};

__attribute__((section(".vectors"), used)) static const struct vectors vectors = {
    &stack_end, {reset, fault, fault, fault, fault, fault},
};
