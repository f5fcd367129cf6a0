/* A plug-in for `palpate stress endings`: a device without hardware that rests at its origin. It writes the force that it
 * was commanded (N, a double) to the start of the file that its address names, in each exchange. A device of this kind
 * has no watchdog: it holds its last force. */
#define _POSIX_C_SOURCE 200809L
#include "palpate_device.h"

#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

struct palpate_device {
    int file;
    uint64_t exchanges;
};

static int held_open(const char *address, palpate_device **device, palpate_capabilities *capabilities, char *message,
                     size_t length) {
    palpate_device *made = calloc(1, sizeof *made);
    if (made == NULL || (made->file = open(address, O_WRONLY)) < 0) {
        snprintf(message, length, "cannot open %s", address);
        free(made);
        return -2; /* -ENOENT */
    }
    capabilities->sensed = PALPATE_X | PALPATE_Y | PALPATE_Z;
    capabilities->actuated = PALPATE_X | PALPATE_Y | PALPATE_Z;
    capabilities->max_force = 12.0;
    capabilities->max_moment = 0.0;
    capabilities->workspace_radius = 0.08;
    capabilities->position_step = 1e-5;
    *device = made;
    return PALPATE_OK;
}

static int held_exchange(palpate_device *device, const palpate_wrench *wrench, palpate_state *state) {
    const double *f = wrench->force;
    double force = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    if (pwrite(device->file, &force, sizeof force, 0) != (ssize_t)sizeof force) {
        return -5; /* -EIO */
    }
    device->exchanges += 1;
    memset(state, 0, sizeof *state);
    state->orientation[0] = 1.0;
    state->time_ns = device->exchanges * 1000000u;
    return PALPATE_OK;
}

static void held_close(palpate_device *device) {
    close(device->file);
    free(device);
}

const palpate_plugin *palpate_plugin_entry(void) {
    static const palpate_plugin plugin = {PALPATE_DEVICE_ABI, 0, "held", held_open, held_exchange, held_close};
    return &plugin;
}
