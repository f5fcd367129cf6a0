/* Firmware of a haptic device on a Cortex-M4, in C99.
 *
 * The protocol, the modes and the watchdog come from palpate_proto.c. This file has the loop (../src/main.rs), the
 * handle (../src/handle.rs) and the response to a failure (../src/failure.rs). */
#include "board.h"

#define TICKS_A_STATE (STATE_US / TICK_US)
#define SEARCH_TICKS (10000000u / TICK_US) /* the search for the reference fails after ten seconds */
#define ALL_AXES ((1u << AXES) - 1)
#define MEAN 4              /* states over which the velocity is a mean */
#define COUNT (COUNT_NM / 100) /* a count in 0.1 um */
#define FAILED 128          /* the fault of a failed firmware: the first of the device's own numbers */

static const palpate_model model = {
    .sensed = 7, /* translations */
    .actuated = 7,
    .major = 1,
    .max_force = 8000000,
    .workspace_radius = 400000,
    .position_step_nm = COUNT_NM,
    .rate = {1000, 1000},
    .name = "board c99",
};

/* The handle: the registers of the mechanism in the units of a report. Change this part for a mechanism of your own:
 * the kinematics turns counts into a pose, and a wrench into the forces of the motors. */

static uint32_t origin[AXES];     /* the counts at the origin, once the marks have passed */
static int32_t past[MEAN][AXES];  /* the last positions (0.1 um) */
static uint32_t newest;           /* the place of the newest */

static void handle_let_go(void) {
    REGISTERS->enable = 0;
    for (int axis = 0; axis < AXES; axis++) {
        REGISTERS->forces[axis] = 0;
    }
}

static void handle_drive(const int32_t wrench[6]) {
    for (int axis = 0; axis < AXES; axis++) {
        REGISTERS->forces[axis] = (uint32_t)wrench[axis];
    }
    REGISTERS->enable = 1;
}

/* The position (0.1 um). The counters wrap, and so does the difference of two counts. */
static int32_t handle_position(int axis) {
    int32_t count = (int32_t)(REGISTERS->counts[axis] - origin[axis]);
    if (count > INT32_MAX / COUNT) {
        return INT32_MAX;
    }
    return count < INT32_MIN / COUNT ? INT32_MIN : count * COUNT;
}

static int handle_find(void) {
    if ((REGISTERS->marked & ALL_AXES) != ALL_AXES) {
        return 0;
    }
    for (int axis = 0; axis < AXES; axis++) {
        origin[axis] = REGISTERS->marks[axis] - (uint32_t)MARK;
        for (int k = 0; k < MEAN; k++) {
            past[k][axis] = handle_position(axis);
        }
    }
    return 1;
}

/* The measurement for a state. Called once a state, because the velocity is the mean over the last states. */
static void handle_measure(palpate_pose *pose) {
    uint32_t oldest = (newest + 1) % MEAN;
    *pose = (palpate_pose){.orientation = {32767, 0, 0, 0}};
    for (int axis = 0; axis < AXES; axis++) {
        int32_t position = handle_position(axis);
        /* 0.1 um in so many states as um/s. */
        int64_t step = (int64_t)position - past[oldest][axis];
        int64_t velocity = step * (int32_t)(100000 / STATE_US) / MEAN;
        velocity = velocity > INT32_MAX ? INT32_MAX : velocity;
        pose->velocity[axis] = (int32_t)(velocity < INT32_MIN ? INT32_MIN : velocity);
        pose->position[axis] = position;
        past[oldest][axis] = position;
    }
    newest = oldest;
}

static palpate_inputs handle_inputs(void) {
    return (palpate_inputs){
        .buttons = (REGISTERS->switches & SWITCH_BUTTON) != 0,
        .powered = REGISTERS->enable != 0,
    };
}

/* Lets go for good, and reports the fault. The old device may be broken, so a new device, without a session, sends the
 * reports. */
void halt(void) {
    static palpate_device failed;
    uint8_t report[PALPATE_LENGTH], packet[PALPATE_PACKET];
    uint32_t now_us = 0;
    handle_let_go();
    palpate_device_init(&failed, &model, NULL, NULL);
    palpate_device_fault(&failed, FAILED);
    line_send_failed((const uint8_t[1]){0}, 1); /* ends the packet that the failure cut off */
    for (;;) {
        handle_let_go();
        palpate_pose pose;
        palpate_inputs inputs = handle_inputs();
        handle_measure(&pose);
        palpate_device_report(&failed, now_us, &inputs, &pose, NULL, report);
        palpate_packet(report, packet);
        line_send_failed(packet, PALPATE_PACKET);
        /* A fault may have stopped the clock: count turns of about three cycles. */
        for (volatile uint32_t turns = STATE_US * CYCLES_A_US / 8; turns > 0; turns--) {
        }
        now_us += STATE_US;
    }
}

static uint32_t seen_ticks, seen_ends;

static int work(void) {
    return clock_ticks != seen_ticks || line_ends != seen_ends;
}

int main(void) {
    static palpate_device device;
    static palpate_decoder decoder;
    uint8_t byte, report[PALPATE_LENGTH], packet[PALPATE_PACKET];
    int32_t wrench[6];
    uint32_t due = TICKS_A_STATE, search = 0;
    int stopped = 0;
    handle_let_go();
    palpate_device_init(&device, &model, NULL, NULL);
    plant_start();
    clock_start();
    line_start();
    line_send((const uint8_t[1]){0}, 1); /* ends all earlier bytes */
    palpate_device_home(&device);
    for (;;) {
        clock_sleep_until(work);
        seen_ends = line_ends;
        while (line_take(&byte)) {
            if (palpate_push(&decoder, byte)) {
                /* The device counts refused reports. */
                palpate_device_receive(&device, decoder.report, PALPATE_LENGTH, clock_now_us(), NULL);
            }
        }
        uint32_t ticks = clock_ticks;
        int ticked = ticks != seen_ticks;
        seen_ticks = ticks;
        if (device.mode == PALPATE_HOMING && ticked) {
            search++;
            if (handle_find()) {
                palpate_device_homed(&device);
            } else if (search > SEARCH_TICKS) {
                palpate_device_fault(&device, PALPATE_HOMING_FAILED);
            }
        }
        uint32_t switches = REGISTERS->switches;
        if ((switches & SWITCH_FAIL) != 0) {
            halt();
        }
        if ((switches & SWITCH_TRAP) != 0) {
            __builtin_trap();
        }
        if ((switches & SWITCH_STOP) != 0) {
            palpate_device_fault(&device, PALPATE_EMERGENCY_STOP);
            stopped = 1;
        } else if (stopped) {
            /* The stop was released: begin anew. */
            palpate_device_reset(&device);
            palpate_device_home(&device);
            stopped = 0;
            search = 0;
        }
        uint32_t now_us = clock_now_us();
        palpate_device_actuate(&device, now_us, wrench);
        if (device.mode == PALPATE_IDLE || device.mode == PALPATE_ACTIVE) {
            handle_drive(wrench);
        } else {
            handle_let_go();
        }
        if (ticks - due < UINT32_MAX / 2) {
            /* After a delay, the loop does not catch up. */
            due = ticks + TICKS_A_STATE;
            palpate_pose pose;
            palpate_inputs inputs = handle_inputs();
            handle_measure(&pose);
            palpate_device_report(&device, now_us, &inputs, &pose, NULL, report);
            palpate_packet(report, packet);
            line_send(packet, PALPATE_PACKET);
        }
    }
}
