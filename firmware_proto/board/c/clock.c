/* Time: the tick of the hardware, the clock in us, and sleep until there is work. See ../src/clock.rs. */
#include "board.h"

#define SYSTICK ((volatile uint32_t *)0xE000E010u) /* control, reload, current */
#define PENDING (*(volatile uint32_t *)0xE000ED04u)
#define TICK_PENDING (1u << 26)
#define CYCLES (TICK_US * CYCLES_A_US)

volatile uint32_t clock_ticks;
volatile uint32_t clock_slept;

void systick(void);

void clock_start(void) {
    SYSTICK[1] = CYCLES - 1;
    SYSTICK[2] = 0;
    SYSTICK[0] = 7; /* the processor's clock, the interrupt, on */
}

/* The tick: the hardware moves on. */
void systick(void) {
    clock_ticks++;
    plant_step();
}

uint32_t clock_now_us(void) {
    static uint32_t last_us;
    for (;;) {
        uint32_t ticks = clock_ticks;
        uint32_t part = (CYCLES - 1 - SYSTICK[2]) / CYCLES_A_US;
        /* The next tick may begin between the two readings. In that case, read again. */
        if (ticks == clock_ticks) {
            uint32_t now_us = ticks * TICK_US + part;
            /* The counter may start over just before its interrupt comes. */
            if (now_us - last_us < UINT32_MAX / 2) {
                last_us = now_us;
            }
            return last_us;
        }
    }
}

void clock_sleep_until(int (*work)(void)) {
    int asleep = 1;
    while (asleep) {
        /* Interrupts wait here, so no interrupt comes between the question and the sleep. An interrupt still wakes the
         * processor, and runs after this section: the measured time is the time of the sleep alone. */
        __asm volatile("cpsid i" ::: "memory");
        asleep = !work();
        if (asleep) {
            uint32_t from = SYSTICK[2];
            __asm volatile("dsb\n wfi" ::: "memory");
            /* The counter counts down, and starts over after zero, when the next tick begins. */
            int ticked = (PENDING & TICK_PENDING) != 0;
            uint32_t to = SYSTICK[2];
            clock_slept += (ticked || to > from ? from + CYCLES : from) - to;
        }
        __asm volatile("cpsie i\n isb" ::: "memory");
    }
}
