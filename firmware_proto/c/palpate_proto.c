/* The firmware protocol of Palpate, version 2, in C99. See palpate_proto.h. */
#include "palpate_proto.h"

#include <string.h>

/* Numbers at an offset, little-endian. */

static uint16_t get16(const uint8_t *at) {
    return (uint16_t)(at[0] | (uint16_t)(at[1] << 8));
}

static uint32_t get32(const uint8_t *at) {
    return (uint32_t)get16(at) | ((uint32_t)get16(at + 2) << 16);
}

static int16_t get16s(const uint8_t *at) {
    uint16_t number = get16(at);
    int16_t result;
    memcpy(&result, &number, sizeof result);
    return result;
}

static int32_t get32s(const uint8_t *at) {
    uint32_t number = get32(at);
    int32_t result;
    memcpy(&result, &number, sizeof result);
    return result;
}

static int64_t get64s(const uint8_t *at) {
    uint64_t number = (uint64_t)get32(at) | ((uint64_t)get32(at + 4) << 32);
    int64_t result;
    memcpy(&result, &number, sizeof result);
    return result;
}

static void put16(uint8_t *at, uint16_t number) {
    at[0] = (uint8_t)(number & 0xFF);
    at[1] = (uint8_t)(number >> 8);
}

static void put32(uint8_t *at, uint32_t number) {
    put16(at, (uint16_t)(number & 0xFFFF));
    put16(at + 2, (uint16_t)(number >> 16));
}

static void put16s(uint8_t *at, int16_t number) {
    put16(at, (uint16_t)number);
}

static void put32s(uint8_t *at, int32_t number) {
    put32(at, (uint32_t)number);
}

static void put64s(uint8_t *at, int64_t number) {
    uint64_t bits = (uint64_t)number;
    put32(at, (uint32_t)(bits & UINT32_MAX));
    put32(at + 4, (uint32_t)(bits >> 32));
}

uint16_t palpate_crc(const uint8_t *bytes, size_t length) {
    uint16_t crc = 0xFFFF;
    size_t i;
    int bit;
    for (i = 0; i < length; i++) {
        crc = (uint16_t)(crc ^ (uint16_t)(bytes[i] << 8));
        for (bit = 0; bit < 8; bit++) {
            crc = (uint16_t)((crc & 0x8000) ? (crc << 1) ^ 0x1021 : crc << 1);
        }
    }
    return crc;
}

/* Checks. Each returns 1, or writes the reason and returns 0. */

static int refuse(palpate_result *result, palpate_field field, uint64_t found) {
    result->error = PALPATE_BAD_FIELD;
    result->field = field;
    result->found = found;
    return 0;
}

static int in_range(palpate_result *result, palpate_field field, uint64_t least, uint64_t most, uint64_t found) {
    return least <= found && found <= most ? 1 : refuse(result, field, found);
}

static int known_bits(palpate_result *result, palpate_field field, unsigned known, unsigned found) {
    return (found & ~known) == 0 ? 1 : refuse(result, field, found);
}

static int reserved(palpate_result *result, const uint8_t *bytes, size_t from, size_t end) {
    uint64_t sum = 0;
    size_t i;
    for (i = from; i < end; i++) {
        sum += bytes[i];
    }
    return in_range(result, PALPATE_FIELD_RESERVED, 0, 0, sum);
}

static int unused(palpate_result *result, const int32_t *numbers, size_t from, size_t end) {
    uint64_t count = 0;
    size_t i;
    for (i = from; i < end; i++) {
        count += numbers[i] != 0;
    }
    return in_range(result, PALPATE_FIELD_UNUSED, 0, 0, count);
}

static int has_session(palpate_result *result, uint32_t session) {
    return in_range(result, PALPATE_FIELD_SESSION, 1, UINT32_MAX, session);
}

static int good_watchdog(palpate_result *result, uint32_t watchdog_us) {
    return in_range(result, PALPATE_FIELD_WATCHDOG, PALPATE_WATCHDOG_LEAST_US, PALPATE_WATCHDOG_MOST_US, watchdog_us);
}

/* Parts of reports. */

static int get_condition(palpate_result *result, const uint8_t *bytes, palpate_condition *condition) {
    condition->time_us = get32(bytes + 8);
    condition->since_us = get32(bytes + 12);
    condition->wrench = get16(bytes + 16);
    condition->buttons = get16(bytes + 18);
    condition->status = bytes[20];
    condition->mode = bytes[21];
    condition->refused = bytes[22];
    condition->fault = bytes[23];
    return known_bits(result, PALPATE_FIELD_STATUS, 0x1F, condition->status) &&
           in_range(result, PALPATE_FIELD_MODE, 0, PALPATE_FAULT, condition->mode) &&
           (condition->mode == PALPATE_FAULT ? in_range(result, PALPATE_FIELD_FAULT, 1, 255, condition->fault)
                                             : in_range(result, PALPATE_FIELD_FAULT, 0, 0, condition->fault));
}

static void put_condition(uint8_t *bytes, const palpate_condition *condition) {
    put32(bytes + 8, condition->time_us);
    put32(bytes + 12, condition->since_us);
    put16(bytes + 16, condition->wrench);
    put16(bytes + 18, condition->buttons);
    bytes[20] = condition->status;
    bytes[21] = condition->mode;
    bytes[22] = condition->refused;
    bytes[23] = condition->fault;
}

static int get_pose(palpate_result *result, const uint8_t *bytes, palpate_pose *pose) {
    /* A length within 1 % of 32767. */
    const uint64_t one = UINT64_C(32767) * 32767;
    uint64_t length = 0;
    int i;
    for (i = 0; i < 3; i++) {
        pose->position[i] = get32s(bytes + 24 + 4 * i);
        pose->velocity[i] = get32s(bytes + 44 + 4 * i);
        pose->angular_velocity[i] = get16s(bytes + 56 + 2 * i);
    }
    for (i = 0; i < 4; i++) {
        int64_t number = get16s(bytes + 36 + 2 * i);
        pose->orientation[i] = (int16_t)number;
        length += (uint64_t)(number * number);
    }
    return in_range(result, PALPATE_FIELD_ORIENTATION_LENGTH, one * 9801 / 10000, one * 10201 / 10000, length);
}

static void put_pose(uint8_t *bytes, const palpate_pose *pose) {
    int i;
    for (i = 0; i < 3; i++) {
        put32s(bytes + 24 + 4 * i, pose->position[i]);
        put32s(bytes + 44 + 4 * i, pose->velocity[i]);
        put16s(bytes + 56 + 2 * i, pose->angular_velocity[i]);
    }
    for (i = 0; i < 4; i++) {
        put16s(bytes + 36 + 2 * i, pose->orientation[i]);
    }
}

static int get_counts(palpate_result *result, const uint8_t *bytes, palpate_counts *counts) {
    int i;
    for (i = 0; i < PALPATE_ENCODERS; i++) {
        counts->counts[i] = get32s(bytes + 24 + 4 * i);
    }
    counts->number = bytes[56];
    return in_range(result, PALPATE_FIELD_ENCODERS, 1, PALPATE_ENCODERS, counts->number) &&
           unused(result, counts->counts, counts->number, PALPATE_ENCODERS) && reserved(result, bytes, 57, 62);
}

static void put_counts(uint8_t *bytes, const palpate_counts *counts) {
    int i;
    for (i = 0; i < PALPATE_ENCODERS; i++) {
        put32s(bytes + 24 + 4 * i, counts->counts[i]);
    }
    bytes[56] = counts->number;
}

static int good_name(palpate_result *result, const uint8_t name[16]) {
    uint64_t wrong = 0;
    size_t length = 0, i;
    while (length < 16 && name[length] != 0) {
        length++;
    }
    for (i = 0; i < 16; i++) {
        int printable = name[i] >= 0x20 && name[i] <= 0x7E;
        wrong += i == 0 || i < length ? !printable : name[i] != 0;
    }
    return in_range(result, PALPATE_FIELD_NAME, 0, 0, wrong);
}

static int get_capabilities(palpate_result *result, const uint8_t *bytes, palpate_capabilities *capabilities) {
    palpate_model *model = &capabilities->model;
    capabilities->hello = get16(bytes + 8);
    model->sensed = bytes[10];
    model->actuated = bytes[11];
    model->major = bytes[12];
    model->minor = bytes[13];
    model->patch = get16(bytes + 14);
    model->max_force = get32(bytes + 16);
    model->max_moment = get32(bytes + 20);
    model->workspace_radius = get32(bytes + 24);
    model->position_step_nm = get32(bytes + 28);
    model->rate[0] = get16(bytes + 32);
    model->rate[1] = get16(bytes + 34);
    capabilities->watchdog_us = get32(bytes + 36);
    capabilities->hello_time_us = get32(bytes + 40);
    model->encoders = bytes[45];
    memcpy(model->name, bytes + 46, 16);
    return in_range(result, PALPATE_FIELD_AXES, 1, 0x3F, model->sensed) &&
           known_bits(result, PALPATE_FIELD_AXES, 0x3F, model->actuated) &&
           in_range(result, PALPATE_FIELD_RATE, 1, UINT16_MAX, model->rate[0]) &&
           in_range(result, PALPATE_FIELD_RATE, model->rate[0], UINT16_MAX, model->rate[1]) &&
           good_name(result, model->name) &&
           in_range(result, PALPATE_FIELD_SENDS, PALPATE_STATE, PALPATE_ENCODERS_KIND, bytes[44]) &&
           (bytes[44] == PALPATE_STATE ? in_range(result, PALPATE_FIELD_ENCODERS, 0, 0, model->encoders)
                                       : in_range(result, PALPATE_FIELD_ENCODERS, 1, PALPATE_ENCODERS, model->encoders)) &&
           good_watchdog(result, capabilities->watchdog_us);
}

static void put_capabilities(uint8_t *bytes, const palpate_capabilities *capabilities) {
    const palpate_model *model = &capabilities->model;
    put16(bytes + 8, capabilities->hello);
    bytes[10] = model->sensed;
    bytes[11] = model->actuated;
    bytes[12] = model->major;
    bytes[13] = model->minor;
    put16(bytes + 14, model->patch);
    put32(bytes + 16, model->max_force);
    put32(bytes + 20, model->max_moment);
    put32(bytes + 24, model->workspace_radius);
    put32(bytes + 28, model->position_step_nm);
    put16(bytes + 32, model->rate[0]);
    put16(bytes + 34, model->rate[1]);
    put32(bytes + 36, capabilities->watchdog_us);
    put32(bytes + 40, capabilities->hello_time_us);
    bytes[44] = model->encoders == 0 ? PALPATE_STATE : PALPATE_ENCODERS_KIND;
    bytes[45] = model->encoders;
    memcpy(bytes + 46, model->name, 16);
}

static int get_geometry(palpate_result *result, const uint8_t *bytes, palpate_geometry *geometry) {
    int i;
    geometry->kinematics = get16(bytes + 8);
    geometry->number = bytes[10];
    for (i = 0; i < PALPATE_PARAMETERS; i++) {
        geometry->parameters[i] = get32s(bytes + 12 + 4 * i);
    }
    return in_range(result, PALPATE_FIELD_PARAMETERS, 0, PALPATE_PARAMETERS, geometry->number) &&
           unused(result, geometry->parameters, geometry->number, PALPATE_PARAMETERS) &&
           reserved(result, bytes, 11, 12) && reserved(result, bytes, 60, 62);
}

static void put_geometry(uint8_t *bytes, const palpate_geometry *geometry) {
    int i;
    put16(bytes + 8, geometry->kinematics);
    bytes[10] = geometry->number;
    for (i = 0; i < PALPATE_PARAMETERS; i++) {
        put32s(bytes + 12 + 4 * i, geometry->parameters[i]);
    }
}

static int get_joint(palpate_result *result, const uint8_t *bytes, palpate_joint *joint) {
    uint64_t size;
    joint->encoder = bytes[8];
    joint->quantity = bytes[9];
    joint->scale = get64s(bytes + 12);
    joint->offset = get32s(bytes + 20);
    size = joint->scale < 0 ? ~(uint64_t)joint->scale + 1 : (uint64_t)joint->scale;
    return in_range(result, PALPATE_FIELD_ENCODER, 0, PALPATE_ENCODERS - 1, joint->encoder) &&
           in_range(result, PALPATE_FIELD_QUANTITY, 0, 1, joint->quantity) &&
           in_range(result, PALPATE_FIELD_SCALE, 1, UINT64_MAX, size) && reserved(result, bytes, 10, 12) &&
           reserved(result, bytes, 24, 62);
}

static void put_joint(uint8_t *bytes, const palpate_joint *joint) {
    bytes[8] = joint->encoder;
    bytes[9] = joint->quantity;
    put64s(bytes + 12, joint->scale);
    put32s(bytes + 20, joint->offset);
}

static int get_wrench(palpate_result *result, const uint8_t *bytes, palpate_wrench *wrench) {
    int i;
    wrench->answers = get16(bytes + 8);
    wrench->flags = bytes[10];
    for (i = 0; i < 3; i++) {
        wrench->force[i] = get32s(bytes + 12 + 4 * i);
        wrench->moment[i] = get32s(bytes + 24 + 4 * i);
    }
    return known_bits(result, PALPATE_FIELD_FLAGS, PALPATE_ENABLE | PALPATE_SAFE_HOLD, wrench->flags) &&
           reserved(result, bytes, 11, 12) && reserved(result, bytes, 36, 62);
}

static void put_wrench(uint8_t *bytes, const palpate_wrench *wrench) {
    int i;
    put16(bytes + 8, wrench->answers);
    bytes[10] = wrench->flags;
    for (i = 0; i < 3; i++) {
        put32s(bytes + 12 + 4 * i, wrench->force[i]);
        put32s(bytes + 24 + 4 * i, wrench->moment[i]);
    }
}

static int get_hello(palpate_result *result, const uint8_t *bytes, palpate_hello *hello) {
    hello->newest = bytes[8];
    hello->watchdog_us = get32(bytes + 12);
    return in_range(result, PALPATE_FIELD_NEWEST, PALPATE_VERSION, 255, hello->newest) &&
           (hello->watchdog_us == 0 || good_watchdog(result, hello->watchdog_us)) && reserved(result, bytes, 9, 12) &&
           reserved(result, bytes, 16, 62);
}

static void put_hello(uint8_t *bytes, const palpate_hello *hello) {
    bytes[8] = hello->newest;
    put32(bytes + 12, hello->watchdog_us);
}

palpate_result palpate_decode(const uint8_t *bytes, size_t length, palpate_report *report) {
    palpate_result result;
    palpate_report found;
    uint16_t sum;
    int good;
    memset(&result, 0, sizeof result);
    memset(&found, 0, sizeof found);
    if (length != PALPATE_LENGTH) {
        result.error = PALPATE_BAD_LENGTH;
        result.found = length;
        return result;
    }
    /* The check sum comes before the version, so that a damaged version is not taken for another version. */
    sum = get16(bytes + 62);
    result.expected = palpate_crc(bytes, 62);
    if (sum != result.expected) {
        result.error = PALPATE_BAD_CHECK_SUM;
        result.found = sum;
        return result;
    }
    if (bytes[0] != PALPATE_VERSION) {
        result.error = PALPATE_BAD_VERSION;
        result.found = bytes[0];
        return result;
    }
    found.kind = bytes[1];
    found.sequence = get16(bytes + 2);
    found.session = get32(bytes + 4);
    switch (found.kind) {
    case PALPATE_STATE:
        good = get_condition(&result, bytes, &found.as.state.condition) && get_pose(&result, bytes, &found.as.state.pose);
        break;
    case PALPATE_ENCODERS_KIND:
        good = get_condition(&result, bytes, &found.as.encoders.condition) &&
               get_counts(&result, bytes, &found.as.encoders.counts);
        break;
    case PALPATE_CAPABILITIES:
        good = has_session(&result, found.session) && get_capabilities(&result, bytes, &found.as.capabilities);
        break;
    case PALPATE_GEOMETRY:
        good = has_session(&result, found.session) && get_geometry(&result, bytes, &found.as.geometry);
        break;
    case PALPATE_JOINT:
        good = has_session(&result, found.session) && get_joint(&result, bytes, &found.as.joint);
        break;
    case PALPATE_WRENCH:
        good = has_session(&result, found.session) && get_wrench(&result, bytes, &found.as.wrench);
        break;
    case PALPATE_HELLO:
        good = has_session(&result, found.session) && get_hello(&result, bytes, &found.as.hello);
        break;
    default:
        result.error = PALPATE_BAD_KIND;
        result.found = found.kind;
        good = 0;
        break;
    }
    if (good) {
        *report = found;
    }
    return result;
}

void palpate_encode(const palpate_report *report, uint8_t bytes[PALPATE_LENGTH]) {
    memset(bytes, 0, PALPATE_LENGTH);
    bytes[0] = PALPATE_VERSION;
    bytes[1] = report->kind;
    put16(bytes + 2, report->sequence);
    put32(bytes + 4, report->session);
    switch (report->kind) {
    case PALPATE_STATE:
        put_condition(bytes, &report->as.state.condition);
        put_pose(bytes, &report->as.state.pose);
        break;
    case PALPATE_ENCODERS_KIND:
        put_condition(bytes, &report->as.encoders.condition);
        put_counts(bytes, &report->as.encoders.counts);
        break;
    case PALPATE_CAPABILITIES:
        put_capabilities(bytes, &report->as.capabilities);
        break;
    case PALPATE_GEOMETRY:
        put_geometry(bytes, &report->as.geometry);
        break;
    case PALPATE_JOINT:
        put_joint(bytes, &report->as.joint);
        break;
    case PALPATE_WRENCH:
        put_wrench(bytes, &report->as.wrench);
        break;
    case PALPATE_HELLO:
        put_hello(bytes, &report->as.hello);
        break;
    default:
        break;
    }
    put16(bytes + 62, palpate_crc(bytes, 62));
}

/* Frames. */

void palpate_frame(const uint8_t report[PALPATE_LENGTH], uint8_t frame[PALPATE_FRAME]) {
    /* Each zero, and the place in front of the report, holds the distance to the next zero. */
    uint8_t distance = 1;
    size_t i;
    frame[PALPATE_FRAME - 1] = 0;
    for (i = PALPATE_LENGTH; i > 0; i--) {
        if (report[i - 1] == 0) {
            frame[i] = distance;
            distance = 1;
        } else {
            frame[i] = report[i - 1];
            distance++;
        }
    }
    frame[0] = distance;
}

static void append(palpate_decoder *decoder, uint8_t byte) {
    if (decoder->length < PALPATE_LENGTH) {
        decoder->report[decoder->length] = byte;
        decoder->length++;
    } else {
        decoder->length = PALPATE_LENGTH + 1;
    }
}

int palpate_push(palpate_decoder *decoder, uint8_t byte) {
    if (byte == 0) {
        int whole = decoder->length == PALPATE_LENGTH && decoder->left == 0;
        if (!whole && decoder->begun && decoder->refused != UINT32_MAX) {
            decoder->refused++;
        }
        decoder->length = 0;
        decoder->left = 0;
        decoder->begun = 0;
        return whole;
    }
    if (decoder->left > 0) {
        decoder->left--;
        append(decoder, byte);
    } else {
        if (decoder->begun) {
            append(decoder, 0);
        }
        decoder->begun = 1;
        decoder->left = (uint8_t)(byte - 1);
    }
    return 0;
}

/* The device's side. */

static void count(uint32_t *counter) {
    if (*counter != UINT32_MAX) {
        (*counter)++;
    }
}

void palpate_device_init(palpate_device *device, const palpate_model *model, const palpate_geometry *geometry,
                         const palpate_joint *joints) {
    memset(device, 0, sizeof *device);
    device->model = *model;
    if (geometry != NULL) {
        device->geometry = *geometry;
    }
    if (joints != NULL) {
        memcpy(device->joints, joints, sizeof device->joints);
    }
    device->mode = PALPATE_BOOT;
    device->watchdog_us = PALPATE_WATCHDOG_US;
}

/* Begins a session, or none, without a wrench and without states. */
static void begin(palpate_device *device, uint32_t session) {
    device->session = session;
    memset(device->sent, 0, sizeof device->sent);
    device->has_last = 0;
    device->has_command = 0;
    device->expired = 0;
    device->answering = 0;
}

static void let_go(palpate_device *device) {
    device->has_command = 0;
    if (device->mode == PALPATE_ACTIVE) {
        device->mode = PALPATE_IDLE;
    }
}

/* Lets go where the last wrench came too long ago. */
static void expire(palpate_device *device, uint32_t now_us) {
    if (device->has_command && (uint32_t)(now_us - device->commanded_us) >= device->watchdog_us) {
        let_go(device);
        device->expired = 1;
        count(&device->counters.watchdog);
    }
}

int palpate_device_home(palpate_device *device) {
    if (device->mode != PALPATE_BOOT && device->mode != PALPATE_IDLE) {
        return 0;
    }
    device->mode = PALPATE_HOMING;
    device->calibrated = 0;
    return 1;
}

int palpate_device_homed(palpate_device *device) {
    if (device->mode != PALPATE_HOMING) {
        return 0;
    }
    device->mode = PALPATE_IDLE;
    device->calibrated = 1;
    return 1;
}

void palpate_device_fault(palpate_device *device, uint8_t fault) {
    if (device->mode != PALPATE_FAULT) {
        device->mode = PALPATE_FAULT;
        /* A fault without a number is a fault nevertheless. */
        device->fault = fault != 0 ? fault : 255;
        device->has_command = 0;
    }
}

int palpate_device_reset(palpate_device *device) {
    if (device->mode != PALPATE_FAULT) {
        return 0;
    }
    device->mode = PALPATE_BOOT;
    device->fault = 0;
    device->calibrated = 0;
    begin(device, 0);
    return 1;
}

static palpate_received take_hello(palpate_device *device, const palpate_report *report, uint32_t now_us) {
    uint32_t watchdog_us = report->as.hello.watchdog_us;
    if (report->session != device->session) {
        if (device->mode == PALPATE_ACTIVE) {
            return PALPATE_REFUSED_BUSY;
        }
        begin(device, report->session);
    }
    if (watchdog_us == 0) {
        watchdog_us = PALPATE_WATCHDOG_US;
    }
    if (device->answering && device->part > 0 && watchdog_us == device->watchdog_us) {
        /* A repetition must not begin a long answer anew each time. */
        return PALPATE_ACCEPTED_HELLO;
    }
    device->watchdog_us = watchdog_us;
    device->hello = report->sequence;
    device->hello_time_us = now_us;
    device->answering = 1;
    device->part = 0;
    return PALPATE_ACCEPTED_HELLO;
}

/* Whether a vector is at most most long; one unit is left to the rounding of its components. */
static int within(const int32_t vector[3], uint32_t most) {
    uint64_t length = 0, limit = (uint64_t)most + 1;
    int i;
    for (i = 0; i < 3; i++) {
        int64_t number = vector[i];
        length += (uint64_t)(number * number);
    }
    /* The square of 2^32 does not fit, and nothing exceeds it. */
    return limit > UINT32_MAX || length <= limit * limit;
}

/* Whether a number is that of a state of this session which is not older than the watchdog. */
static int recent(const palpate_device *device, uint16_t state, uint32_t now_us) {
    const palpate_sent *sent = &device->sent[state % PALPATE_STATES];
    return sent->used && sent->sequence == state && (uint32_t)(now_us - sent->time_us) <= device->watchdog_us;
}

static palpate_received take_wrench(palpate_device *device, const palpate_report *report, uint32_t now_us) {
    const palpate_wrench *wrench = &report->as.wrench;
    uint16_t step;
    int newer;
    if (report->session != device->session) {
        return PALPATE_REFUSED_SESSION;
    }
    step = device->has_last ? (uint16_t)(report->sequence - device->last) : 1;
    newer = step >= 1 && step <= 0x7FFF;
    if ((wrench->flags & PALPATE_ENABLE) == 0) {
        if (newer) {
            device->last = report->sequence;
            device->has_last = 1;
        }
        let_go(device);
        return PALPATE_ACCEPTED_RELEASE;
    }
    if (device->mode != PALPATE_IDLE && device->mode != PALPATE_ACTIVE) {
        return PALPATE_REFUSED_MODE;
    }
    if (!newer) {
        return PALPATE_REFUSED_SEQUENCE;
    }
    if (!recent(device, wrench->answers, now_us)) {
        return PALPATE_REFUSED_AGE;
    }
    if (!within(wrench->force, device->model.max_force) || !within(wrench->moment, device->model.max_moment)) {
        return PALPATE_REFUSED_LIMIT;
    }
    device->last = report->sequence;
    device->has_last = 1;
    device->mode = PALPATE_ACTIVE;
    device->commanded = *wrench;
    device->commanded_sequence = report->sequence;
    device->commanded_us = now_us;
    device->has_command = 1;
    device->fresh = 1;
    return PALPATE_ACCEPTED_WRENCH;
}

static void count_received(palpate_counters *counters, palpate_received received, palpate_error error) {
    switch (received) {
    case PALPATE_ACCEPTED_HELLO:
    case PALPATE_ACCEPTED_WRENCH:
    case PALPATE_ACCEPTED_RELEASE:
        count(&counters->accepted);
        break;
    case PALPATE_REFUSED_REPORT:
        count(error == PALPATE_BAD_LENGTH      ? &counters->length
              : error == PALPATE_BAD_CHECK_SUM ? &counters->check_sum
              : error == PALPATE_BAD_VERSION   ? &counters->version
              : error == PALPATE_BAD_KIND      ? &counters->kind
                                               : &counters->range);
        break;
    case PALPATE_REFUSED_BUSY:
        count(&counters->busy);
        break;
    case PALPATE_REFUSED_SESSION:
        count(&counters->session);
        break;
    case PALPATE_REFUSED_MODE:
        count(&counters->mode);
        break;
    case PALPATE_REFUSED_SEQUENCE:
        count(&counters->sequence);
        break;
    case PALPATE_REFUSED_AGE:
        count(&counters->age);
        break;
    case PALPATE_REFUSED_LIMIT:
        count(&counters->limit);
        break;
    }
}

palpate_received palpate_device_receive(palpate_device *device, const uint8_t *bytes, size_t length, uint32_t now_us,
                                        palpate_result *result) {
    palpate_report report;
    palpate_result decoded;
    palpate_received received = PALPATE_REFUSED_REPORT;
    expire(device, now_us);
    decoded = palpate_decode(bytes, length, &report);
    if (decoded.error == PALPATE_OK) {
        if (report.kind == PALPATE_HELLO) {
            received = take_hello(device, &report, now_us);
        } else if (report.kind == PALPATE_WRENCH) {
            received = take_wrench(device, &report, now_us);
        } else {
            decoded.error = PALPATE_BAD_KIND;
            decoded.found = report.kind;
        }
    }
    count_received(&device->counters, received, decoded.error);
    if (received >= PALPATE_REFUSED_REPORT) {
        device->refused++;
    }
    if (result != NULL) {
        *result = decoded;
    }
    return received;
}

void palpate_device_actuate(palpate_device *device, uint32_t now_us, int32_t wrench[6]) {
    expire(device, now_us);
    if (!device->has_command) {
        if (device->has_force) {
            device->has_force = 0;
            device->since_us = now_us;
        }
        memset(wrench, 0, 6 * sizeof wrench[0]);
        return;
    }
    if (device->fresh) {
        device->fresh = 0;
        device->in_force = device->commanded_sequence;
        device->has_force = 1;
        device->since_us = now_us;
        device->expired = 0;
    }
    memcpy(wrench, device->commanded.force, 3 * sizeof wrench[0]);
    memcpy(wrench + 3, device->commanded.moment, 3 * sizeof wrench[0]);
}

/* The next part of the answer to a hello. */
static void answer(palpate_device *device, palpate_report *report) {
    unsigned parts = device->model.encoders == 0 ? 1 : device->model.encoders + 2u;
    unsigned part = device->part;
    if (part == 0) {
        report->kind = PALPATE_CAPABILITIES;
        report->as.capabilities.hello = device->hello;
        report->as.capabilities.hello_time_us = device->hello_time_us;
        report->as.capabilities.watchdog_us = device->watchdog_us;
        report->as.capabilities.model = device->model;
    } else if (part == 1) {
        report->kind = PALPATE_GEOMETRY;
        report->as.geometry = device->geometry;
    } else {
        unsigned encoder = (part - 2) % PALPATE_ENCODERS;
        report->kind = PALPATE_JOINT;
        report->as.joint = device->joints[encoder];
        report->as.joint.encoder = (uint8_t)encoder;
    }
    device->part = (uint8_t)(part + 1);
    device->answering = part + 1 < parts;
}

void palpate_device_report(palpate_device *device, uint32_t now_us, const palpate_inputs *inputs,
                           const palpate_pose *pose, const palpate_counts *counts, uint8_t bytes[PALPATE_LENGTH]) {
    palpate_report report;
    palpate_condition condition;
    palpate_sent *sent;
    expire(device, now_us);
    memset(&report, 0, sizeof report);
    report.sequence = device->sequence;
    report.session = device->session;
    device->sequence++;
    if (device->answering) {
        answer(device, &report);
        palpate_encode(&report, bytes);
        return;
    }
    sent = &device->sent[report.sequence % PALPATE_STATES];
    sent->used = 1;
    sent->sequence = report.sequence;
    sent->time_us = now_us;
    condition.time_us = now_us;
    condition.since_us = device->since_us;
    condition.wrench = device->has_force ? device->in_force : 0;
    condition.buttons = inputs->buttons;
    condition.status = (uint8_t)((device->calibrated ? PALPATE_CALIBRATED : 0) | (inputs->powered ? PALPATE_POWERED : 0) |
                                 (device->expired ? PALPATE_WATCHDOG : 0) | (inputs->limited ? PALPATE_LIMITED : 0) |
                                 (device->has_force ? PALPATE_IN_FORCE : 0));
    condition.mode = device->mode;
    condition.refused = device->refused;
    condition.fault = device->fault;
    if (counts != NULL) {
        report.kind = PALPATE_ENCODERS_KIND;
        report.as.encoders.condition = condition;
        report.as.encoders.counts = *counts;
    } else {
        report.kind = PALPATE_STATE;
        report.as.state.condition = condition;
        if (pose != NULL) {
            report.as.state.pose = *pose;
        }
    }
    palpate_encode(&report, bytes);
}
