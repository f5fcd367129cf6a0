/* A plug-in that needs no hardware: a mass of 0.1 kg on a spring and a damper, which the commanded force moves.
 *
 * Build:  cc -std=c99 -shared -fPIC -o example.so example.c
 * Scene:  connect = "plugin:example.so"
 *
 * The address makes the device fail, to see what Palpate does: "nan" gives states that are no numbers, "lost" loses the
 * device after a hundred exchanges and takes it back at the next attempt, "hang" never answers again after a hundred
 * exchanges, and "refuse" cannot be opened. "release" lets go of the mass for the second hundred exchanges, and "fault" has
 * the fault 7 after a hundred.
 */
#define _POSIX_C_SOURCE 200809L
#include "palpate_device.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* The time of one exchange. A real plug-in asks its device. */
static const double PERIOD = 1e-3;
static const double MASS = 0.1, DAMPING = 2.0, STIFFNESS = 50.0;

struct palpate_device {
    double position[3], velocity[3];
    uint64_t exchanges;
    char fault[16];
};

static int example_open(const char *address, palpate_device **device, palpate_capabilities *capabilities, char *message,
                        size_t length) {
    palpate_device *made;
    if (strcmp(address, "refuse") == 0) {
        snprintf(message, length, "the device does not answer; check its power");
        return -19; /* -ENODEV */
    }
    made = calloc(1, sizeof *made);
    if (made == NULL) {
        snprintf(message, length, "no memory");
        return -12; /* -ENOMEM */
    }
    snprintf(made->fault, sizeof made->fault, "%s", address);
    capabilities->sensed = PALPATE_X | PALPATE_Y | PALPATE_Z;
    capabilities->actuated = PALPATE_X | PALPATE_Y | PALPATE_Z;
    capabilities->max_force = 5.0;
    capabilities->max_moment = 0.0;
    capabilities->workspace_radius = 0.1;
    capabilities->position_step = 1e-5;
    *device = made;
    return PALPATE_OK;
}

static int example_exchange(palpate_device *device, const palpate_wrench *wrench, palpate_state *state) {
    int axis, renders;
    device->exchanges += 1;
    if (device->exchanges > 100 && strcmp(device->fault, "lost") == 0) {
        return -19;
    }
    while (device->exchanges > 100 && strcmp(device->fault, "hang") == 0) {
        /* A vendor's library that never returns. */
        struct timespec second = {1, 0};
        nanosleep(&second, NULL);
    }
    memset(state, 0, sizeof *state);
    if (device->exchanges > 100 && strcmp(device->fault, "fault") == 0) {
        state->rendering = PALPATE_FAULT + 7;
    }
    if (device->exchanges > 100 && device->exchanges <= 200 && strcmp(device->fault, "release") == 0) {
        state->rendering = PALPATE_LET_GO;
    }
    renders = state->rendering == PALPATE_RENDERS;
    for (axis = 0; axis < 3; axis++) {
        double push = renders ? wrench->force[axis] : 0.0;
        double force = push - STIFFNESS * device->position[axis] - DAMPING * device->velocity[axis];
        device->velocity[axis] += force / MASS * PERIOD;
        device->position[axis] += device->velocity[axis] * PERIOD;
        state->position[axis] = device->position[axis];
        state->velocity[axis] = device->velocity[axis];
    }
    if (strcmp(device->fault, "nan") == 0) {
        state->position[0] = NAN;
    }
    state->orientation[0] = 1.0;
    state->time_ns = device->exchanges * 1000000u;
    return PALPATE_OK;
}

static void example_close(palpate_device *device) {
    free(device);
}

const palpate_plugin *palpate_plugin_entry(void) {
    static const palpate_plugin plugin = {PALPATE_DEVICE_ABI, 0, "example", example_open, example_exchange, example_close};
    return &plugin;
}
