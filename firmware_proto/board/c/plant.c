/* The simulated mechanism behind the registers. The mechanism is no part of the firmware: delete this file for
 * a board of your own.
 *
 * The model, the numbers, and the commands of a test are the same as in ../src/plant.rs. */
#include "board.h"

#define MASS 0.2f       /* kg */
#define DAMPING 4.0f    /* N s/m, of mechanism and hand */
#define FRICTION 0.05f  /* N, of an axis */
#define STIFFNESS 100.0f /* N/m, of the hand */
#define REACH 0.04f     /* m: the handle stops there */
#define START 0.005f    /* m, on each axis */
#define STEP ((float)TICK_US * 1e-6f)

static const int32_t origin[AXES] = {12345, -6789, 424242}; /* the counters at the origin */
static float position[AXES] = {START, START, START};
static float velocity[AXES];
static uint32_t steps;

static int32_t nm(float metres) {
    return (int32_t)(metres * 1e9f);
}

static void move_axis(int axis, float motor) {
    float force = motor - DAMPING * velocity[axis] - STIFFNESS * position[axis];
    float free = velocity[axis] + STEP / MASS * force;
    float brake = STEP / MASS * FRICTION;
    if (free > brake) {
        velocity[axis] = free - brake;
    } else if (free < -brake) {
        velocity[axis] = free + brake;
    } else {
        velocity[axis] = 0.0f;
    }
    position[axis] += STEP * velocity[axis];
    if (position[axis] > REACH || position[axis] < -REACH) {
        position[axis] = position[axis] > 0.0f ? REACH : -REACH;
        velocity[axis] = 0.0f;
    }
}

/* Sets the counter, and keeps the count at the mark once the handle has passed the mark. */
static void encode(int axis) {
    int32_t at = nm(position[axis]);
    int32_t count = at / COUNT_NM - (at % COUNT_NM < 0);
    REGISTERS->counts[axis] = (uint32_t)(origin[axis] + count);
    if (count <= MARK) {
        REGISTERS->marks[axis] = (uint32_t)(origin[axis] + MARK);
        REGISTERS->marked |= 1u << axis;
    }
}

static void put_word(uint32_t word) {
    for (int k = 0; k < 4; k++) {
        bench_put((uint8_t)(word >> (8 * k)));
    }
}

static void listen(const uint32_t forces[AXES]) {
    uint8_t byte;
    if (!bench_take(&byte)) {
        return;
    }
    switch (byte) {
    case 'e': REGISTERS->switches |= SWITCH_STOP; break;
    case 'E': REGISTERS->switches &= ~SWITCH_STOP; break;
    case 'b': REGISTERS->switches |= SWITCH_BUTTON; break;
    case 'B': REGISTERS->switches &= ~SWITCH_BUTTON; break;
    case 'p': REGISTERS->switches |= SWITCH_FAIL; break;
    case 't': REGISTERS->switches |= SWITCH_TRAP; break;
    case '?':
        put_word(steps);
        put_word(clock_slept);
        for (int axis = 0; axis < AXES; axis++) {
            put_word((uint32_t)nm(position[axis]));
        }
        for (int axis = 0; axis < AXES; axis++) {
            put_word(forces[axis]);
        }
        put_word(REGISTERS->enable);
        break;
    default: break;
    }
}

void plant_start(void) {
    bench_start();
}

void plant_step(void) {
    uint32_t forces[AXES] = {0, 0, 0};
    steps++;
    for (int axis = 0; axis < AXES; axis++) {
        if (REGISTERS->enable != 0) {
            forces[axis] = REGISTERS->forces[axis];
        }
        move_axis(axis, (float)(int32_t)forces[axis] * 1e-6f);
        encode(axis);
    }
    listen(forces);
}
