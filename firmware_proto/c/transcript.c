/* Runs transcripts (../tests/transcript) through the implementation in C99: reads commands from the standard input, and
 * writes each command with its answers. Lines of answers in the input are left out, so a file of golden vectors comes
 * out as it is. */
#include "palpate_proto.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WORDS 16
#define BYTES 1024

static const char *const FIELDS[] = {
    "session",
    "squared length of the orientation",
    "status",
    "mode",
    "fault",
    "flags",
    "newest version",
    "watchdog",
    "axes",
    "rate of states",
    "kind of states",
    "number of encoders",
    "count of unused numbers that are not zero",
    "count of bytes in the name that are no printable ASCII",
    "number of parameters",
    "encoder",
    "quantity",
    "size of the counts per unit",
    "sum of the reserved bytes",
};

static void fail(const char *why) {
    fprintf(stderr, "transcript: %s\n", why);
    exit(1);
}

static unsigned digit(char c) {
    if (c >= '0' && c <= '9') {
        return (unsigned)(c - '0');
    }
    if (c >= 'a' && c <= 'f') {
        return (unsigned)(c - 'a') + 10;
    }
    fail("no hexadecimal digit");
    return 0;
}

static size_t unhex(const char *text, uint8_t *bytes) {
    size_t length = strlen(text) / 2, i;
    if (length > BYTES) {
        fail("too many bytes");
    }
    for (i = 0; i < length; i++) {
        bytes[i] = (uint8_t)(digit(text[2 * i]) << 4 | digit(text[2 * i + 1]));
    }
    return length;
}

static void print_hex(const uint8_t *bytes, size_t length) {
    size_t i;
    printf("  ");
    for (i = 0; i < length; i++) {
        printf("%02x", bytes[i]);
    }
    printf("\n");
}

static void print_numbers(const char *before, const int32_t *numbers, size_t count, const char *after) {
    size_t i;
    printf("  %s", before);
    for (i = 0; i < count; i++) {
        printf("%s%" PRId32, i == 0 ? "" : " ", numbers[i]);
    }
    printf("%s\n", after);
}

static void print_refusal(const palpate_result *result) {
    printf("  refused ");
    switch (result->error) {
    case PALPATE_BAD_LENGTH:
        printf("length %" PRIu64 "\n", result->found);
        break;
    case PALPATE_BAD_CHECK_SUM:
        printf("check sum %" PRIu64 ", expected %u\n", result->found, (unsigned)result->expected);
        break;
    case PALPATE_BAD_VERSION:
        printf("version %" PRIu64 "\n", result->found);
        break;
    case PALPATE_BAD_KIND:
        printf("kind %" PRIu64 "\n", result->found);
        break;
    case PALPATE_BAD_FIELD:
        printf("%s %" PRIu64 "\n", FIELDS[result->field], result->found);
        break;
    case PALPATE_OK:
        fail("a report was refused for nothing");
    }
}

static void print_condition(const palpate_condition *condition) {
    printf("  time %" PRIu32 " us\n", condition->time_us);
    printf("  since %" PRIu32 " us\n", condition->since_us);
    printf("  wrench %u\n", (unsigned)condition->wrench);
    printf("  buttons %u\n", (unsigned)condition->buttons);
    printf("  status %u\n", (unsigned)condition->status);
    printf("  mode %u\n", (unsigned)condition->mode);
    printf("  refused %u\n", (unsigned)condition->refused);
    printf("  fault %u\n", (unsigned)condition->fault);
}

static void print_model(const palpate_capabilities *capabilities) {
    const palpate_model *model = &capabilities->model;
    size_t i;
    printf("  hello %u\n", (unsigned)capabilities->hello);
    printf("  sensed %u\n  actuated %u\n", (unsigned)model->sensed, (unsigned)model->actuated);
    printf("  firmware %u.%u.%u\n", (unsigned)model->major, (unsigned)model->minor, (unsigned)model->patch);
    printf("  force %" PRIu32 " uN\n", model->max_force);
    printf("  moment %" PRIu32 " uN m\n", model->max_moment);
    printf("  radius %" PRIu32 " (0.1 um)\n", model->workspace_radius);
    printf("  step %" PRIu32 " nm\n", model->position_step_nm);
    printf("  rate %u to %u Hz\n", (unsigned)model->rate[0], (unsigned)model->rate[1]);
    printf("  watchdog %" PRIu32 " us\n", capabilities->watchdog_us);
    printf("  hello time %" PRIu32 " us\n", capabilities->hello_time_us);
    printf("  sends %d\n", model->encoders == 0 ? 1 : 2);
    printf("  encoders %u\n  model ", (unsigned)model->encoders);
    for (i = 0; i < 16 && model->name[i] != 0; i++) {
        putchar(model->name[i]);
    }
    printf("\n");
}

static void print_report(const palpate_report *report) {
    static const struct {
        uint8_t kind;
        const char *name;
    } NAMES[] = {
        {PALPATE_STATE, "state"},       {PALPATE_ENCODERS_KIND, "encoders"}, {PALPATE_CAPABILITIES, "capabilities"},
        {PALPATE_GEOMETRY, "geometry"}, {PALPATE_JOINT, "joint"},            {PALPATE_WRENCH, "wrench"},
        {PALPATE_HELLO, "hello"},
    };
    size_t i;
    for (i = 0; i < sizeof NAMES / sizeof NAMES[0]; i++) {
        if (NAMES[i].kind == report->kind) {
            printf("  %s\n", NAMES[i].name);
        }
    }
    printf("  sequence %u\n  session %" PRIu32 "\n", (unsigned)report->sequence, report->session);
    switch (report->kind) {
    case PALPATE_STATE: {
        const palpate_pose *pose = &report->as.state.pose;
        int32_t w[4], v[3];
        for (i = 0; i < 4; i++) {
            w[i] = pose->orientation[i];
        }
        for (i = 0; i < 3; i++) {
            v[i] = pose->angular_velocity[i];
        }
        print_condition(&report->as.state.condition);
        print_numbers("position ", pose->position, 3, " (0.1 um)");
        print_numbers("orientation ", w, 4, "");
        print_numbers("velocity ", pose->velocity, 3, " um/s");
        print_numbers("angular velocity ", v, 3, " mrad/s");
        break;
    }
    case PALPATE_ENCODERS_KIND:
        print_condition(&report->as.encoders.condition);
        print_numbers("counts ", report->as.encoders.counts.counts, 8, "");
        printf("  number %u\n", (unsigned)report->as.encoders.counts.number);
        break;
    case PALPATE_CAPABILITIES:
        print_model(&report->as.capabilities);
        break;
    case PALPATE_GEOMETRY:
        printf("  kinematics %u\n", (unsigned)report->as.geometry.kinematics);
        printf("  number %u\n", (unsigned)report->as.geometry.number);
        print_numbers("parameters ", report->as.geometry.parameters, 12, "");
        break;
    case PALPATE_JOINT:
        printf("  encoder %u\n", (unsigned)report->as.joint.encoder);
        printf("  quantity %u\n", (unsigned)report->as.joint.quantity);
        printf("  scale %" PRId64 " (0.000001)\n", report->as.joint.scale);
        printf("  offset %" PRId32 "\n", report->as.joint.offset);
        break;
    case PALPATE_WRENCH:
        printf("  answers %u\n", (unsigned)report->as.wrench.answers);
        printf("  flags %u\n", (unsigned)report->as.wrench.flags);
        print_numbers("force ", report->as.wrench.force, 3, " uN");
        print_numbers("moment ", report->as.wrench.moment, 3, " uN m");
        break;
    case PALPATE_HELLO:
        printf("  newest %u\n", (unsigned)report->as.hello.newest);
        printf("  watchdog %" PRIu32 " us\n", report->as.hello.watchdog_us);
        break;
    default:
        fail("a report of no kind was accepted");
    }
}

/* The report in text, which must be valid. */
static palpate_report valid(const char *text) {
    uint8_t bytes[BYTES];
    palpate_report report;
    if (palpate_decode(bytes, unhex(text, bytes), &report).error != PALPATE_OK) {
        fail("a report that should be valid is refused");
    }
    return report;
}

static void decode(const uint8_t *bytes, size_t length) {
    uint8_t again[PALPATE_LENGTH];
    palpate_report report;
    palpate_result result = palpate_decode(bytes, length, &report);
    if (result.error != PALPATE_OK) {
        print_refusal(&result);
        return;
    }
    print_report(&report);
    palpate_encode(&report, again);
    if (memcmp(bytes, again, PALPATE_LENGTH) != 0) {
        fail("a report is encoded to other bytes than it came from");
    }
}

static void init(palpate_device *device, char **words, int count) {
    palpate_geometry geometry;
    palpate_joint joints[PALPATE_ENCODERS];
    palpate_model model = valid(words[1]).as.capabilities.model;
    int i;
    memset(&geometry, 0, sizeof geometry);
    memset(joints, 0, sizeof joints);
    for (i = 0; i < PALPATE_ENCODERS; i++) {
        joints[i].scale = 1;
    }
    for (i = 2; i < count; i++) {
        palpate_report report = valid(words[i]);
        if (report.kind == PALPATE_GEOMETRY) {
            geometry = report.as.geometry;
        } else if (report.kind == PALPATE_JOINT) {
            joints[report.as.joint.encoder] = report.as.joint;
        } else {
            fail("a device has a geometry and joints");
        }
    }
    palpate_device_init(device, &model, &geometry, joints);
}

static void print_mode(int done, const palpate_device *device) {
    printf("  %s, mode %u\n", done ? "yes" : "no", (unsigned)device->mode);
}

static void receive(palpate_device *device, uint32_t now_us, const uint8_t *bytes, size_t length) {
    static const char *const NAMES[] = {"accepted hello", "accepted wrench", "accepted release", "",
                                        "refused busy",   "refused session", "refused mode",     "refused sequence",
                                        "refused age",    "refused limit"};
    palpate_result result;
    palpate_received received = palpate_device_receive(device, bytes, length, now_us, &result);
    if (received == PALPATE_REFUSED_REPORT) {
        print_refusal(&result);
    } else {
        printf("  %s\n", NAMES[received]);
    }
}

static void report(palpate_device *device, char **words) {
    uint8_t bytes[PALPATE_LENGTH];
    palpate_report measured = valid(words[5]);
    palpate_inputs inputs;
    int counts = measured.kind == PALPATE_ENCODERS_KIND;
    inputs.buttons = (uint16_t)strtoul(words[2], NULL, 10);
    inputs.powered = words[3][0] == '1';
    inputs.limited = words[4][0] == '1';
    palpate_device_report(device, (uint32_t)strtoul(words[1], NULL, 10), &inputs,
                          counts ? NULL : &measured.as.state.pose, counts ? &measured.as.encoders.counts : NULL, bytes);
    print_hex(bytes, sizeof bytes);
}

static void print_counters(const palpate_counters *c) {
    printf("  %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32, c->accepted, c->length,
           c->check_sum, c->version, c->kind, c->range, c->busy);
    printf(" %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 "\n", c->session, c->mode, c->sequence,
           c->age, c->limit, c->watchdog);
}

int main(void) {
    static char line[8192], copy[8192];
    palpate_decoder decoder;
    palpate_device device;
    memset(&decoder, 0, sizeof decoder);
    memset(&device, 0, sizeof device);
    while (fgets(line, sizeof line, stdin) != NULL) {
        uint8_t bytes[BYTES];
        char *words[WORDS] = {NULL};
        int count = 0;
        size_t i, length;
        if (strncmp(line, "  ", 2) == 0) {
            continue;
        }
        fputs(line, stdout);
        if (line[0] == '#' || line[0] == '\n') {
            continue;
        }
        strcpy(copy, line);
        for (words[0] = strtok(copy, " \n"); words[count] != NULL && count < WORDS - 1;) {
            words[++count] = strtok(NULL, " \n");
        }
        if (strcmp(words[0], "decode") == 0) {
            length = count > 1 ? unhex(words[1], bytes) : 0;
            decode(bytes, length);
        } else if (strcmp(words[0], "packet") == 0) {
            uint8_t packet[PALPATE_PACKET];
            unhex(words[1], bytes);
            palpate_packet(bytes, packet);
            print_hex(packet, sizeof packet);
        } else if (strcmp(words[0], "stream") == 0) {
            memset(&decoder, 0, sizeof decoder);
        } else if (strcmp(words[0], "push") == 0) {
            length = unhex(words[1], bytes);
            for (i = 0; i < length; i++) {
                if (palpate_push(&decoder, bytes[i])) {
                    print_hex(decoder.report, PALPATE_LENGTH);
                }
            }
            printf("  refused %" PRIu32 "\n", decoder.refused);
        } else if (strcmp(words[0], "device") == 0) {
            init(&device, words, count);
        } else if (strcmp(words[0], "home") == 0) {
            print_mode(palpate_device_home(&device), &device);
        } else if (strcmp(words[0], "homed") == 0) {
            print_mode(palpate_device_homed(&device), &device);
        } else if (strcmp(words[0], "reset") == 0) {
            print_mode(palpate_device_reset(&device), &device);
        } else if (strcmp(words[0], "fault") == 0) {
            palpate_device_fault(&device, (uint8_t)strtoul(words[1], NULL, 10));
            print_mode(1, &device);
        } else if (strcmp(words[0], "receive") == 0) {
            length = count > 2 ? unhex(words[2], bytes) : 0;
            receive(&device, (uint32_t)strtoul(words[1], NULL, 10), bytes, length);
        } else if (strcmp(words[0], "actuate") == 0) {
            int32_t wrench[6];
            palpate_device_actuate(&device, (uint32_t)strtoul(words[1], NULL, 10), wrench);
            print_numbers("", wrench, 6, "");
        } else if (strcmp(words[0], "report") == 0) {
            report(&device, words);
        } else if (strcmp(words[0], "counters") == 0) {
            print_counters(&device.counters);
        } else {
            fail("no such command");
        }
    }
    return 0;
}
