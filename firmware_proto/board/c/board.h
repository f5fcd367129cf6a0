/* The board: a Cortex-M4 at 25 MHz with CMSDK UARTs (QEMU's mps2-an386), and the declarations that its files share.
 *
 * The firmware in ../src is the model of this firmware in C99, and has the longer comments. See also
 * docs/src/devices.md, "Firmware". */
#ifndef BOARD_H
#define BOARD_H

#include "palpate_proto.h"

/* registers: between the firmware and its mechanism (../src/registers.rs). On a board of your own they belong to
 * counters, inputs and amplifiers. Here the simulated mechanism (plant.c) replaces the hardware. */

#define AXES 3
#define COUNT_NM 10000 /* length of one count */
#define MARK 200       /* position of the reference marks (counts) */

#define SWITCH_STOP 0x1u
#define SWITCH_BUTTON 0x2u
#define SWITCH_FAIL 0x4u /* asks the firmware to fail, for a test of the response */
#define SWITCH_TRAP 0x8u /* asks for an unknown instruction, for the same test */

typedef struct {
    volatile uint32_t counts[AXES]; /* signed; a counter starts at any number, and wraps */
    volatile uint32_t marks[AXES];  /* counts at the marks, valid if the bit in marked is set */
    volatile uint32_t marked;       /* bit k: the mark of axis k has passed */
    volatile uint32_t switches;
    volatile uint32_t forces[AXES]; /* uN, signed */
    volatile uint32_t enable;       /* not zero: the amplifiers are on */
} board_registers;

#define REGISTERS ((board_registers *)0x20010000u)

/* clock: the tick, and the time. */

#define CYCLES_A_US 25u
#define TICK_US 250u
#define STATE_US 1000u

extern volatile uint32_t clock_ticks;
extern volatile uint32_t clock_slept; /* cycles that the processor slept */

void clock_start(void);
uint32_t clock_now_us(void);
void clock_sleep_until(int (*work)(void));

/* uart: the line to the host (UART0, by interrupts), and the line between a test and the mechanism (UART1). */

extern volatile uint32_t line_ends; /* ends of packets that have come */

void line_start(void);
int line_take(uint8_t *byte);
void line_send(const uint8_t *bytes, uint32_t length);
void line_send_failed(const uint8_t *bytes, uint32_t length);
void line_received(void);
void line_sent(void);
void bench_start(void);
int bench_take(uint8_t *byte);
void bench_put(uint8_t byte);

/* plant: the simulated mechanism. */

void plant_start(void);
void plant_step(void);

/* main and failure. */

int main(void);
void halt(void);

#endif
