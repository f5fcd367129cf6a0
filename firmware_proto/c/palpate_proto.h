/* The firmware protocol of Palpate, version 2, in C99: reports, frames, and the device's side.
 *
 * For firmware that is not written in Rust. No memory is allocated, no function has state of its own, and of the C
 * library only string.h is used. The book's page on the protocol (docs/src/protocol.md) describes every byte and every
 * rule; the reference is the Rust crate beside this folder. The golden vectors (../vectors) and random transcripts hold
 * this implementation to it, byte by byte.
 *
 * All times are in microseconds of the device's own clock, and wrap.
 */
#ifndef PALPATE_PROTO_H
#define PALPATE_PROTO_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PALPATE_VERSION 2
#define PALPATE_LENGTH 64   /* bytes of a report */
#define PALPATE_FRAME 66    /* bytes of a report in a stream */
#define PALPATE_ENCODERS 8
#define PALPATE_PARAMETERS 12
#define PALPATE_STATES 32   /* states that a wrench may answer */

#define PALPATE_WATCHDOG_US UINT32_C(10000)
#define PALPATE_WATCHDOG_LEAST_US UINT32_C(2000)
#define PALPATE_WATCHDOG_MOST_US UINT32_C(100000)

/* Kinds of report. */
#define PALPATE_STATE 0x01
#define PALPATE_ENCODERS_KIND 0x02
#define PALPATE_CAPABILITIES 0x03
#define PALPATE_GEOMETRY 0x04
#define PALPATE_JOINT 0x05
#define PALPATE_WRENCH 0x81
#define PALPATE_HELLO 0x82

/* Bits of the status. */
#define PALPATE_CALIBRATED 0x01
#define PALPATE_POWERED 0x02
#define PALPATE_WATCHDOG 0x04
#define PALPATE_LIMITED 0x08
#define PALPATE_IN_FORCE 0x10

/* Bits of the flags. */
#define PALPATE_ENABLE 0x01
#define PALPATE_SAFE_HOLD 0x02

/* Modes. */
#define PALPATE_BOOT 0
#define PALPATE_HOMING 1
#define PALPATE_IDLE 2
#define PALPATE_ACTIVE 3
#define PALPATE_FAULT 4

/* Faults; from 128 on the device's own. */
#define PALPATE_EMERGENCY_STOP 1
#define PALPATE_AMPLIFIER 2
#define PALPATE_ENCODER 3
#define PALPATE_TEMPERATURE 4
#define PALPATE_SUPPLY 5
#define PALPATE_HOMING_FAILED 6

/* The condition of a device: what both forms of a state begin with. */
typedef struct {
    uint32_t time_us;
    uint32_t since_us;
    uint16_t wrench;
    uint16_t buttons;
    uint8_t status;
    uint8_t mode;
    uint8_t refused;
    uint8_t fault;
} palpate_condition;

typedef struct {
    int32_t position[3];         /* 0.1 um */
    int16_t orientation[4];      /* w, x, y, z; 32767 is 1 */
    int32_t velocity[3];         /* um/s */
    int16_t angular_velocity[3]; /* mrad/s */
} palpate_pose;

typedef struct {
    palpate_condition condition;
    palpate_pose pose;
} palpate_state;

typedef struct {
    int32_t counts[PALPATE_ENCODERS];
    uint8_t number;
} palpate_counts;

typedef struct {
    palpate_condition condition;
    palpate_counts counts;
} palpate_encoders;

/* The properties of a device that do not change. */
typedef struct {
    uint8_t sensed;
    uint8_t actuated;
    uint8_t major, minor;
    uint16_t patch;
    uint32_t max_force;        /* uN */
    uint32_t max_moment;       /* uN m */
    uint32_t workspace_radius; /* 0.1 um */
    uint32_t position_step_nm;
    uint16_t rate[2];          /* Hz */
    uint8_t encoders;          /* 0 for a device that sends poses */
    uint8_t name[16];
} palpate_model;

typedef struct {
    uint16_t hello;
    uint32_t hello_time_us;
    uint32_t watchdog_us;
    palpate_model model;
} palpate_capabilities;

typedef struct {
    uint16_t kinematics;
    uint8_t number;
    int32_t parameters[PALPATE_PARAMETERS];
} palpate_geometry;

typedef struct {
    uint8_t encoder;
    uint8_t quantity;
    int64_t scale;
    int32_t offset;
} palpate_joint;

typedef struct {
    uint16_t answers;
    uint8_t flags;
    int32_t force[3];  /* uN */
    int32_t moment[3]; /* uN m */
} palpate_wrench;

typedef struct {
    uint8_t newest;
    uint32_t watchdog_us;
} palpate_hello;

/* A report of any kind; kind says which member of the union it is. */
typedef struct {
    uint8_t kind;
    uint16_t sequence;
    uint32_t session;
    union {
        palpate_state state;
        palpate_encoders encoders;
        palpate_capabilities capabilities;
        palpate_geometry geometry;
        palpate_joint joint;
        palpate_wrench wrench;
        palpate_hello hello;
    } as;
} palpate_report;

/* Why bytes are not a valid report. */
typedef enum {
    PALPATE_OK = 0,
    PALPATE_BAD_LENGTH,
    PALPATE_BAD_CHECK_SUM,
    PALPATE_BAD_VERSION,
    PALPATE_BAD_KIND,
    PALPATE_BAD_FIELD
} palpate_error;

/* Fields that can be out of range. */
typedef enum {
    PALPATE_FIELD_SESSION,
    PALPATE_FIELD_ORIENTATION_LENGTH,
    PALPATE_FIELD_STATUS,
    PALPATE_FIELD_MODE,
    PALPATE_FIELD_FAULT,
    PALPATE_FIELD_FLAGS,
    PALPATE_FIELD_NEWEST,
    PALPATE_FIELD_WATCHDOG,
    PALPATE_FIELD_AXES,
    PALPATE_FIELD_RATE,
    PALPATE_FIELD_SENDS,
    PALPATE_FIELD_ENCODERS,
    PALPATE_FIELD_UNUSED,
    PALPATE_FIELD_NAME,
    PALPATE_FIELD_PARAMETERS,
    PALPATE_FIELD_ENCODER,
    PALPATE_FIELD_QUANTITY,
    PALPATE_FIELD_SCALE,
    PALPATE_FIELD_RESERVED
} palpate_field;

/* The error, with the value that was found (length, check sum, version, kind or field). */
typedef struct {
    palpate_error error;
    palpate_field field; /* where error is PALPATE_BAD_FIELD */
    uint64_t found;
    uint16_t expected;   /* where error is PALPATE_BAD_CHECK_SUM */
} palpate_result;

/* CRC-16/IBM-3740 of length bytes. */
uint16_t palpate_crc(const uint8_t *bytes, size_t length);

/* Decodes a report. report is written only where the result is PALPATE_OK. */
palpate_result palpate_decode(const uint8_t *bytes, size_t length, palpate_report *report);

/* Encodes a report. */
void palpate_encode(const palpate_report *report, uint8_t bytes[PALPATE_LENGTH]);

/* The frame of a report in a stream of bytes. */
void palpate_frame(const uint8_t report[PALPATE_LENGTH], uint8_t frame[PALPATE_FRAME]);

/* Finds the reports in a stream of bytes. All zeros is a new decoder. */
typedef struct {
    uint8_t report[PALPATE_LENGTH];
    uint8_t length; /* one more than PALPATE_LENGTH where there were too many bytes */
    uint8_t left;
    uint8_t begun;
    uint32_t refused;
} palpate_decoder;

/* Takes the next byte. Returns 1 where it completes a report, which is in decoder->report until the next call. */
int palpate_push(palpate_decoder *decoder, uint8_t byte);

/* What became of a report that a device received. */
typedef enum {
    PALPATE_ACCEPTED_HELLO,
    PALPATE_ACCEPTED_WRENCH,
    PALPATE_ACCEPTED_RELEASE,
    PALPATE_REFUSED_REPORT, /* the result says why */
    PALPATE_REFUSED_BUSY,
    PALPATE_REFUSED_SESSION,
    PALPATE_REFUSED_MODE,
    PALPATE_REFUSED_SEQUENCE,
    PALPATE_REFUSED_AGE,
    PALPATE_REFUSED_LIMIT
} palpate_received;

/* Counts of received reports; they saturate. */
typedef struct {
    uint32_t accepted, length, check_sum, version, kind, range, busy, session, mode, sequence, age, limit, watchdog;
} palpate_counters;

typedef struct {
    uint32_t time_us;
    uint16_t sequence;
    uint8_t used;
} palpate_sent;

/* The device's side. Use the functions below; read counters, mode and session. */
typedef struct {
    palpate_model model;
    palpate_geometry geometry;
    palpate_joint joints[PALPATE_ENCODERS];
    palpate_counters counters;
    uint32_t session;
    uint32_t watchdog_us;
    uint32_t since_us;
    palpate_sent sent[PALPATE_STATES];
    palpate_wrench commanded;
    uint32_t commanded_us;
    uint32_t hello_time_us;
    uint16_t commanded_sequence;
    uint16_t sequence;
    uint16_t last;
    uint16_t in_force;
    uint16_t hello;
    uint8_t mode;
    uint8_t calibrated;
    uint8_t fault;
    uint8_t has_last;
    uint8_t has_command;
    uint8_t fresh;
    uint8_t has_force;
    uint8_t expired;
    uint8_t answering;
    uint8_t part;
    uint8_t refused;
} palpate_device;

/* What the device knows of itself at the time of a state. */
typedef struct {
    uint16_t buttons;
    uint8_t powered;
    uint8_t limited;
} palpate_inputs;

/* Begins in the mode boot. geometry and joints may be NULL for a device that sends poses. */
void palpate_device_init(palpate_device *device, const palpate_model *model, const palpate_geometry *geometry,
                         const palpate_joint *joints);

/* Begins the search for the reference; returns 0 and does nothing unless the mode is boot or idle. */
int palpate_device_home(palpate_device *device);

/* The reference was found; returns 0 and does nothing unless the mode is homing. */
int palpate_device_homed(palpate_device *device);

/* A fault (not zero). Cut the amplifiers yourself, too. */
void palpate_device_fault(palpate_device *device, uint8_t fault);

/* Leaves the mode fault for boot, and ends the session; returns 0 and does nothing in any other mode. */
int palpate_device_reset(palpate_device *device);

/* Takes a report that came at now_us. result may be NULL. */
palpate_received palpate_device_receive(palpate_device *device, const uint8_t *bytes, size_t length, uint32_t now_us,
                                        palpate_result *result);

/* The wrench that the amplifiers apply from now_us on: force (uN), then moment (uN m). Call it each time the amplifiers
 * are set, at least every 35 minutes. */
void palpate_device_actuate(palpate_device *device, uint32_t now_us, int32_t wrench[6]);

/* The next report to send; pose, or counts for a device that sends counts, was measured at now_us. The other is NULL. */
void palpate_device_report(palpate_device *device, uint32_t now_us, const palpate_inputs *inputs,
                           const palpate_pose *pose, const palpate_counts *counts, uint8_t bytes[PALPATE_LENGTH]);

#ifdef __cplusplus
}
#endif

#endif
