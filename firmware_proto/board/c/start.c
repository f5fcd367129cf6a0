/* The start of the processor: the vectors, the memory of the program, the floating-point unit. */
#include "board.h"

#include <string.h>

/* Addresses that link.ld sets. */
extern uint32_t stack_top, data_from, data_start, data_end, bss_start, bss_end;

void reset(void);
void systick(void);

/* The compiler turns copies of structures into calls of these functions. The option keeps the loops from becoming such
 * calls themselves. */
__attribute__((optimize("no-tree-loop-distribute-patterns"))) void *memcpy(void *to, const void *from, size_t length) {
    uint8_t *put = to;
    const uint8_t *take = from;
    while (length-- > 0) {
        *put++ = *take++;
    }
    return to;
}

__attribute__((optimize("no-tree-loop-distribute-patterns"))) void *memset(void *to, int byte, size_t length) {
    uint8_t *put = to;
    while (length-- > 0) {
        *put++ = (uint8_t)byte;
    }
    return to;
}

#define AT(address) ((uintptr_t)(address))

/* The vectors of the processor, then the vectors of the board. */
__attribute__((section(".vectors"), used)) static const uintptr_t vectors[18] = {
    AT(&stack_top),
    AT(reset),
    AT(halt), /* non-maskable interrupt */
    AT(halt), /* hard fault */
    AT(halt), /* memory fault */
    AT(halt), /* bus fault */
    AT(halt), /* usage fault */
    0, 0, 0, 0,
    AT(halt), /* supervisor call */
    AT(halt), /* debug monitor */
    0,
    AT(halt), /* PendSV */
    AT(systick),
    AT(line_received), /* interrupt 0 */
    AT(line_sent),     /* interrupt 1 */
};

void reset(void) {
    /* Full access to the floating-point unit, before the first instruction that uses it. */
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20;
    __asm volatile("dsb\n isb" ::: "memory");
    memcpy(&data_start, &data_from, (size_t)((char *)&data_end - (char *)&data_start));
    memset(&bss_start, 0, (size_t)((char *)&bss_end - (char *)&bss_start));
    main();
    halt();
}
