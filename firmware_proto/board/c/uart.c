/* The UARTs of the board: CMSDK APB UART (Arm DDI 0479). See ../src/uart.rs. */
#include "board.h"

#define BYTES 256u       /* of each ring */
#define CYCLES_A_BIT 16u /* 1.56 Mbaud */

#define CANNOT_PUT 0x1u
#define CAN_TAKE 0x2u
#define DIRECTIONS 0x3u
#define INTERRUPTS 0xCu
#define SENT 0x1u
#define RECEIVED 0x2u

typedef struct {
    volatile uint32_t data, state, control, interrupts, divider;
} uart_registers;

#define UART0 ((uart_registers *)0x40004000u)
#define UART1 ((uart_registers *)0x40005000u)
#define NVIC_ENABLE (*(volatile uint32_t *)0xE000E100u)
#define NVIC_PEND (*(volatile uint32_t *)0xE000E200u)

/* A ring of bytes between an interrupt and the loop: only the putting side changes head, and only the
 * taking side changes tail. */
typedef struct {
    volatile uint8_t bytes[BYTES];
    volatile uint32_t head, tail;
} ring;

static ring incoming, outgoing;
volatile uint32_t line_ends;

static uint32_t room(const ring *ring) {
    return (ring->tail + BYTES - 1 - ring->head) % BYTES;
}

static void put(ring *ring, uint8_t byte) {
    if (room(ring) > 0) {
        ring->bytes[ring->head] = byte;
        ring->head = (ring->head + 1) % BYTES;
    }
}

static int take(ring *ring, uint8_t *byte) {
    if (ring->tail == ring->head) {
        return 0;
    }
    *byte = ring->bytes[ring->tail];
    ring->tail = (ring->tail + 1) % BYTES;
    return 1;
}

void line_start(void) {
    UART0->divider = CYCLES_A_BIT;
    UART0->control = DIRECTIONS | INTERRUPTS;
    NVIC_ENABLE = SENT | RECEIVED; /* bits 0 and 1 are interrupts 0 (received) and 1 (sent) */
}

int line_take(uint8_t *byte) {
    return take(&incoming, byte);
}

/* Sends all bytes, or no byte if room is missing: the host sees a gap in the sequence, never half a packet. */
void line_send(const uint8_t *bytes, uint32_t length) {
    if (room(&outgoing) >= length) {
        for (uint32_t k = 0; k < length; k++) {
            put(&outgoing, bytes[k]);
        }
        /* Only the interrupt touches the UART, so the loop and the interrupt need no lock. */
        NVIC_PEND = 1u << 1;
    }
}

/* Sends without interrupts, for a firmware that has failed. Waits a bounded time for each byte. */
void line_send_failed(const uint8_t *bytes, uint32_t length) {
    for (uint32_t k = 0; k < length; k++) {
        uint32_t patience = 16 * 10 * CYCLES_A_BIT;
        while ((UART0->state & CANNOT_PUT) != 0 && patience > 0) {
            patience--;
        }
        UART0->data = bytes[k];
    }
}

void line_received(void) {
    UART0->interrupts = RECEIVED;
    while ((UART0->state & CAN_TAKE) != 0) {
        uint8_t byte = (uint8_t)UART0->data;
        /* If the ring is full the byte is lost, and the check sum of the packet is wrong. */
        put(&incoming, byte);
        if (byte == 0) {
            line_ends++;
        }
    }
}

void line_sent(void) {
    uint8_t byte;
    UART0->interrupts = SENT;
    while ((UART0->state & CANNOT_PUT) == 0 && take(&outgoing, &byte)) {
        UART0->data = byte;
    }
}

void bench_start(void) {
    UART1->divider = CYCLES_A_BIT;
    UART1->control = DIRECTIONS;
}

int bench_take(uint8_t *byte) {
    if ((UART1->state & CAN_TAKE) == 0) {
        return 0;
    }
    *byte = (uint8_t)UART1->data;
    return 1;
}

void bench_put(uint8_t byte) {
    if ((UART1->state & CANNOT_PUT) == 0) {
        UART1->data = byte;
    }
}
