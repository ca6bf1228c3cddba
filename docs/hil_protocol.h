/* Flyaround hardware-in-the-loop link, protocol 2: a decoder and encoder for boards, header only.
 *
 * C99, no allocation, no alignment or byte-order assumption. The layout is described in
 * hil_protocol.md; hil_vectors.json holds packets to test against. MIT licence, as the rest.
 */
#ifndef FLYAROUND_HIL_PROTOCOL_H
#define FLYAROUND_HIL_PROTOCOL_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define FLY_PROTOCOL_VERSION 2u
#define FLY_HEADER_BYTES 24u
#define FLY_CRC_BYTES 4u
#define FLY_MAX_PAYLOAD_BYTES (1u << 22)
#define FLY_NO_FRAME 0xFFFFFFFFu
#define FLY_STAGE_NAME_BYTES 24u
#define FLY_STAGE_BYTES 32u

enum fly_type {
  FLY_HELLO = 1, FLY_HELLO_ACK = 2, FLY_TIME_SYNC_REQUEST = 3, FLY_TIME_SYNC_REPLY = 4,
  FLY_FRAME_HEADER = 5, FLY_FRAME_CHUNK = 6, FLY_POSE = 7, FLY_CREDIT = 8, FLY_TRUTH = 9,
  FLY_BYE = 10, FLY_ERROR = 11
};
enum fly_encoding { FLY_RAW = 0, FLY_ZSTD = 1, FLY_PNG = 2 };
/* GenICam Pixel Format Naming Convention; HELLO's pixel_formats has one bit each, in this order from bit 0. */
#define FLY_MONO8 0x01080001u
#define FLY_MONO10 0x01100003u  /* 16 bits each, the number right-aligned */
#define FLY_MONO12P 0x010C0047u /* two numbers in three bytes */
#define FLY_MONO16 0x01100007u
#define FLY_RGB8 0x02180014u
#define FLY_TAKES_MONO8 1u
#define FLY_TAKES_MONO10 2u
#define FLY_TAKES_MONO12P 4u
#define FLY_TAKES_MONO16 8u
#define FLY_TAKES_RGB8 16u
/* Optional fields after the fixed part of FRAME_HEADER and POSE: u16 tag, u16 length, value. */
#define FLY_TAKES_FIELDS 0x8000u /* in HELLO's encodings */
#define FLY_MAX_FIELDS_BYTES 1024u
#define FLY_FIELD_BYTES 4u /* tag and length */
#define FLY_SUN_BYTES 24u
#define FLY_COVARIANCE_BYTES 84u
enum fly_field_tag { FLY_SUN_CAMERA = 1, FLY_TRANSFER = 2, FLY_COVARIANCE = 3 };
enum fly_transfer { FLY_LINEAR = 0, FLY_SRGB = 1, FLY_GAMMA = 2 };
enum fly_mode { FLY_LOCKSTEP = 0, FLY_REALTIME = 1 };
enum fly_error_code {
  FLY_OTHER = 0, FLY_VERSION = 1, FLY_CORRUPT = 2, FLY_INCOMPLETE = 3, FLY_MODEL = 4, FLY_BUSY = 5,
  FLY_FORMAT = 6
};

/* What fly_parse and the payload readers return. */
enum fly_status {
  FLY_OK = 0, FLY_TOO_SHORT = -1, FLY_BAD_MAGIC = -2, FLY_BAD_LENGTH = -3, FLY_BAD_CRC = -4,
  FLY_BAD_VERSION = -5, FLY_BAD_PAYLOAD = -6
};

/* ---- little-endian fields --------------------------------------------------------------- */

static inline uint16_t fly_u16(const uint8_t *p) { return (uint16_t)(p[0] | (uint16_t)p[1] << 8); }
static inline uint32_t fly_u32(const uint8_t *p) {
  return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}
static inline uint64_t fly_u64(const uint8_t *p) { return (uint64_t)fly_u32(p) | (uint64_t)fly_u32(p + 4) << 32; }
static inline double fly_f64(const uint8_t *p) { /* IEEE 754 binary64 */
  uint64_t bits = fly_u64(p);
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}
static inline float fly_f32(const uint8_t *p) { /* IEEE 754 binary32 */
  uint32_t bits = fly_u32(p);
  float value;
  memcpy(&value, &bits, sizeof value);
  return value;
}
/* Text of at most n bytes from a zero-padded field; out holds n + 1. */
static inline void fly_text(char *out, const uint8_t *p, size_t n) {
  memcpy(out, p, n);
  out[n] = '\0';
}

/* ---- CRC-32 (IEEE 802.3, reflected 0xEDB88320: the one of zlib) --------------------------- */

static inline uint32_t fly_crc32(const uint8_t *p, size_t n) {
  uint32_t crc = 0xFFFFFFFFu;
  while (n--) {
    crc ^= *p++;
    for (int k = 0; k < 8; k++) crc = crc >> 1 ^ (0xEDB88320u & (0u - (crc & 1u)));
  }
  return ~crc;
}

/* ---- COBS (serial): returns the decoded length, or 0 for a damaged frame ------------------- */

static inline size_t fly_cobs_decode(uint8_t *out, const uint8_t *in, size_t n) {
  size_t i = 0, o = 0;
  while (i < n) {
    uint8_t code = in[i++];
    if (code == 0 || i + code - 1u > n) return 0;
    for (uint8_t k = 1; k < code; k++) {
      if (in[i] == 0) return 0;
      out[o++] = in[i++];
    }
    if (code != 0xFF && i < n) out[o++] = 0;
  }
  return o;
}

/* Stuffs n bytes; out holds n + n / 254 + 1. Returns the stuffed length; zeros on both sides delimit it on the line. */
static inline size_t fly_cobs_encode(uint8_t *out, const uint8_t *in, size_t n) {
  size_t o = 1, code = 0; /* where the next byte and the code of its block go */
  for (size_t i = 0; i < n; i++) {
    if (in[i] != 0) out[o++] = in[i];
    if (in[i] == 0 || (o - code == 255 && i + 1 < n)) {
      out[code] = (uint8_t)(o - code);
      code = o++;
    }
  }
  out[code] = (uint8_t)(o - code);
  return o;
}

/* A serial line, byte by byte: buffer is the caller's, as long as the longest packet it takes and one byte in 254 more. */
struct fly_serial {
  uint8_t *buffer;
  size_t capacity, used;
};
/* Take one byte. At the end of a frame: its decoded length, the packet in buffer until the next call, for fly_parse. 0:
 * more is to come. A frame that is damaged or too long gives one byte, which fly_parse refuses; then it goes on. */
static inline size_t fly_serial_take(struct fly_serial *line, uint8_t byte) {
  size_t n = line->used;
  if (byte != 0) {
    if (line->used < line->capacity) line->buffer[line->used] = byte;
    if (line->used <= line->capacity) line->used++;
    return 0;
  }
  line->used = 0;
  if (n == 0) return 0; /* between two frames */
  if (n <= line->capacity) n = fly_cobs_decode(line->buffer, line->buffer, n); /* in place: it never writes ahead */
  else n = 0;
  return n ? n : 1;
}

/* ---- packet ------------------------------------------------------------------------------- */

struct fly_packet {
  uint16_t version;
  uint8_t type, flags;
  uint64_t session_id;
  uint32_t sequence, payload_bytes;
  const uint8_t *payload; /* into the caller's buffer */
};

/* Parse exactly one packet (without TCP prefix or COBS). The CRC is checked before the version. */
static inline int fly_parse(struct fly_packet *packet, const uint8_t *p, size_t n) {
  if (n < FLY_HEADER_BYTES + FLY_CRC_BYTES) return FLY_TOO_SHORT;
  if (memcmp(p, "FLYA", 4) != 0) return FLY_BAD_MAGIC;
  packet->version = fly_u16(p + 4);
  packet->type = p[6];
  packet->flags = p[7];
  packet->session_id = fly_u64(p + 8);
  packet->sequence = fly_u32(p + 16);
  packet->payload_bytes = fly_u32(p + 20);
  packet->payload = p + FLY_HEADER_BYTES;
  if (packet->payload_bytes > FLY_MAX_PAYLOAD_BYTES ||
      packet->payload_bytes != n - FLY_HEADER_BYTES - FLY_CRC_BYTES)
    return FLY_BAD_LENGTH;
  if (fly_crc32(p, n - FLY_CRC_BYTES) != fly_u32(p + n - FLY_CRC_BYTES)) return FLY_BAD_CRC;
  return packet->version == FLY_PROTOCOL_VERSION ? FLY_OK : FLY_BAD_VERSION;
}

/* ---- optional fields ---------------------------------------------------------------------- */

struct fly_field {
  uint16_t tag, length;
  const uint8_t *value;
};
/* Read the next of the fields between *at and end. 1: one was read; 0: there are no more; FLY_BAD_PAYLOAD: cut short. */
static inline int fly_next_field(struct fly_field *field, const uint8_t **at, const uint8_t *end) {
  size_t left = (size_t)(end - *at);
  if (left == 0) return 0;
  if (left < FLY_FIELD_BYTES || left > FLY_MAX_FIELDS_BYTES) return FLY_BAD_PAYLOAD;
  field->tag = fly_u16(*at);
  field->length = fly_u16(*at + 2);
  if (field->length > left - FLY_FIELD_BYTES) return FLY_BAD_PAYLOAD;
  field->value = *at + FLY_FIELD_BYTES;
  *at = field->value + field->length;
  return 1;
}

/* ---- payloads ----------------------------------------------------------------------------- */

struct fly_hello {
  uint16_t protocol, encodings, window, pixel_formats;
  uint8_t takes_fields;
  char model_name[65], method[33], board[65];
  uint8_t model_sha256[32];
};
static inline int fly_read_hello(struct fly_hello *m, const uint8_t *p, uint32_t n) {
  if (n != 200) return FLY_BAD_PAYLOAD;
  m->protocol = fly_u16(p);
  m->encodings = (uint16_t)(fly_u16(p + 2) & ~FLY_TAKES_FIELDS);
  m->takes_fields = (fly_u16(p + 2) & FLY_TAKES_FIELDS) != 0;
  m->window = fly_u16(p + 4);
  m->pixel_formats = fly_u16(p + 6);
  fly_text(m->model_name, p + 8, 64);
  memcpy(m->model_sha256, p + 72, 32);
  fly_text(m->method, p + 104, 32);
  fly_text(m->board, p + 136, 64);
  return FLY_OK;
}

struct fly_hello_ack {
  uint16_t width_px, height_px, window;
  uint8_t bits, encoding, mode, truth, takes_fields; /* takes_fields: POSE may carry fields, too */
  uint32_t pixel_format, chunk_bytes, camera_bytes;
  char target_name[65];
  uint8_t target_sha256[32];
  const char *camera_json; /* camera_bytes long, not zero-terminated */
};
static inline int fly_read_hello_ack(struct fly_hello_ack *m, const uint8_t *p, uint32_t n) {
  if (n < 120 || fly_u32(p + 116) != n - 120) return FLY_BAD_PAYLOAD;
  m->width_px = fly_u16(p);
  m->height_px = fly_u16(p + 2);
  m->pixel_format = fly_u32(p + 4);
  m->bits = p[8];
  m->encoding = p[9];
  m->mode = p[10];
  m->truth = p[11];
  m->window = fly_u16(p + 12);
  m->takes_fields = fly_u16(p + 14) & 1u;
  m->chunk_bytes = fly_u32(p + 16);
  fly_text(m->target_name, p + 20, 64);
  memcpy(m->target_sha256, p + 84, 32);
  m->camera_bytes = n - 120;
  m->camera_json = (const char *)p + 120;
  return FLY_OK;
}

struct fly_time_sync {
  uint64_t asked_ns, received_ns, sent_ns; /* the last two in replies only, as is what follows */
  uint32_t newest_frame, tells;            /* tells: 1 where newest_frame is told; FLY_NO_FRAME before the first */
};
static inline int fly_read_time_sync_request(struct fly_time_sync *m, const uint8_t *p, uint32_t n) {
  if (n != 8) return FLY_BAD_PAYLOAD;
  m->asked_ns = fly_u64(p);
  m->received_ns = m->sent_ns = 0;
  m->newest_frame = FLY_NO_FRAME;
  m->tells = 0;
  return FLY_OK;
}
static inline int fly_read_time_sync_reply(struct fly_time_sync *m, const uint8_t *p, uint32_t n) {
  if (n != 32) return FLY_BAD_PAYLOAD;
  m->asked_ns = fly_u64(p);
  m->received_ns = fly_u64(p + 8);
  m->sent_ns = fly_u64(p + 16);
  m->newest_frame = fly_u32(p + 24);
  m->tells = fly_u32(p + 28);
  return FLY_OK;
}

struct fly_frame_header {
  uint32_t frame_id, pixel_format, total_bytes, chunk_count;
  uint16_t width_px, height_px;
  uint16_t roi_x_px, roi_y_px, roi_width_px, roi_height_px; /* of the detector, before binning */
  uint8_t bits, encoding, binning_x, binning_y;
  double exposure_s, t_s;
  uint64_t camera_frame, exposure_start_ns, exposure_end_ns; /* UTC since 1970 [ns], 0: unknown */
  uint64_t host_send_ns;
  char epoch_utc[41];
  uint8_t has_sun, transfer; /* transfer: of the pixels; a board refuses those that it does not know */
  double sun_camera[3];      /* unit vector to the Sun, camera frame */
};
static inline int fly_read_frame_header(struct fly_frame_header *m, const uint8_t *p, uint32_t n) {
  struct fly_field field;
  const uint8_t *at = p + 120, *end = p + n;
  int more;
  if (n < 120 || n > 120 + FLY_MAX_FIELDS_BYTES) return FLY_BAD_PAYLOAD;
  m->frame_id = fly_u32(p);
  m->width_px = fly_u16(p + 4);
  m->height_px = fly_u16(p + 6);
  m->pixel_format = fly_u32(p + 8);
  m->bits = p[12];
  m->encoding = p[13];
  m->binning_x = p[14];
  m->binning_y = p[15];
  m->total_bytes = fly_u32(p + 16);
  m->chunk_count = fly_u32(p + 20);
  m->roi_x_px = fly_u16(p + 24);
  m->roi_y_px = fly_u16(p + 26);
  m->roi_width_px = fly_u16(p + 28);
  m->roi_height_px = fly_u16(p + 30);
  m->camera_frame = fly_u64(p + 32);
  m->exposure_s = fly_f64(p + 40);
  m->t_s = fly_f64(p + 48);
  m->exposure_start_ns = fly_u64(p + 56);
  m->exposure_end_ns = fly_u64(p + 64);
  m->host_send_ns = fly_u64(p + 72);
  fly_text(m->epoch_utc, p + 80, 40);
  m->has_sun = 0;
  m->transfer = FLY_LINEAR;
  for (int k = 0; k < 3; k++) m->sun_camera[k] = 0.0;
  while ((more = fly_next_field(&field, &at, end)) == 1) { /* unknown tags are skipped */
    if (field.tag == FLY_SUN_CAMERA) {
      if (field.length != FLY_SUN_BYTES) return FLY_BAD_PAYLOAD;
      m->has_sun = 1;
      for (int k = 0; k < 3; k++) m->sun_camera[k] = fly_f64(field.value + 8 * k);
    } else if (field.tag == FLY_TRANSFER) {
      if (field.length != 1) return FLY_BAD_PAYLOAD;
      m->transfer = field.value[0];
    }
  }
  return more == 0 ? FLY_OK : FLY_BAD_PAYLOAD;
}

struct fly_frame_chunk {
  uint32_t frame_id, index, offset, data_bytes;
  const uint8_t *data;
};
static inline int fly_read_frame_chunk(struct fly_frame_chunk *m, const uint8_t *p, uint32_t n) {
  if (n < 16 || fly_u32(p + 12) != n - 16) return FLY_BAD_PAYLOAD;
  m->frame_id = fly_u32(p);
  m->index = fly_u32(p + 4);
  m->offset = fly_u32(p + 8);
  m->data_bytes = n - 16;
  m->data = p + 16;
  return FLY_OK;
}

struct fly_pose {
  uint32_t frame_id;
  uint8_t accepted, has_pose;
  uint16_t stage_count, reason_bytes;
  double confidence;
  double q_camera_from_target_wxyz[4], t_camera_from_target_m[3];
  uint64_t receive_ns, start_ns, end_ns;
  const uint8_t *stages; /* stage_count of FLY_STAGE_BYTES: name[24], f64 milliseconds */
  const char *reason;    /* reason_bytes long, not zero-terminated */
  uint8_t has_covariance;
  float covariance[21]; /* upper triangle, row by row, of turn [rad] and shift [m] in camera axes */
};
static inline int fly_read_pose(struct fly_pose *m, const uint8_t *p, uint32_t n) {
  struct fly_field field;
  const uint8_t *at, *end = p + n;
  int more;
  if (n < 100) return FLY_BAD_PAYLOAD;
  m->frame_id = fly_u32(p);
  m->accepted = p[4];
  m->has_pose = p[5];
  m->stage_count = fly_u16(p + 6);
  m->confidence = fly_f64(p + 8);
  for (int k = 0; k < 4; k++) m->q_camera_from_target_wxyz[k] = fly_f64(p + 16 + 8 * k);
  for (int k = 0; k < 3; k++) m->t_camera_from_target_m[k] = fly_f64(p + 48 + 8 * k);
  m->receive_ns = fly_u64(p + 72);
  m->start_ns = fly_u64(p + 80);
  m->end_ns = fly_u64(p + 88);
  m->reason_bytes = fly_u16(p + 96);
  m->stages = p + 100;
  m->reason = (const char *)p + 100 + FLY_STAGE_BYTES * m->stage_count;
  m->has_covariance = 0;
  memset(m->covariance, 0, sizeof m->covariance);
  if (n < 100u + FLY_STAGE_BYTES * m->stage_count + m->reason_bytes) return FLY_BAD_PAYLOAD;
  at = (const uint8_t *)m->reason + m->reason_bytes;
  if (end - at > (ptrdiff_t)FLY_MAX_FIELDS_BYTES) return FLY_BAD_PAYLOAD;
  while ((more = fly_next_field(&field, &at, end)) == 1)
    if (field.tag == FLY_COVARIANCE) {
      if (field.length != FLY_COVARIANCE_BYTES) return FLY_BAD_PAYLOAD;
      m->has_covariance = 1;
      for (int k = 0; k < 21; k++) m->covariance[k] = fly_f32(field.value + 4 * k);
    }
  return more == 0 ? FLY_OK : FLY_BAD_PAYLOAD;
}
static inline void fly_read_stage(char name[25], double *ms, const struct fly_pose *m, unsigned k) {
  fly_text(name, m->stages + FLY_STAGE_BYTES * k, FLY_STAGE_NAME_BYTES);
  *ms = fly_f64(m->stages + FLY_STAGE_BYTES * k + FLY_STAGE_NAME_BYTES);
}

struct fly_credit {
  uint32_t frame_id;
  uint16_t window;
};
static inline int fly_read_credit(struct fly_credit *m, const uint8_t *p, uint32_t n) {
  if (n != 8) return FLY_BAD_PAYLOAD;
  m->frame_id = fly_u32(p);
  m->window = fly_u16(p + 4);
  return FLY_OK;
}

/* TRUTH, BYE and ERROR end in text of text_bytes, not zero-terminated. */
struct fly_tail {
  uint32_t frame_id; /* FLY_NO_FRAME where none */
  uint16_t code;     /* ERROR only */
  uint32_t text_bytes;
  const char *text;
};
static inline int fly_read_truth(struct fly_tail *m, const uint8_t *p, uint32_t n) {
  if (n < 8 || fly_u32(p + 4) != n - 8) return FLY_BAD_PAYLOAD;
  m->frame_id = fly_u32(p);
  m->code = 0;
  m->text_bytes = n - 8;
  m->text = (const char *)p + 8;
  return FLY_OK;
}
static inline int fly_read_bye(struct fly_tail *m, const uint8_t *p, uint32_t n) {
  if (n < 4 || fly_u16(p) != n - 4) return FLY_BAD_PAYLOAD;
  m->frame_id = FLY_NO_FRAME;
  m->code = 0;
  m->text_bytes = n - 4;
  m->text = (const char *)p + 4;
  return FLY_OK;
}
static inline int fly_read_error(struct fly_tail *m, const uint8_t *p, uint32_t n) {
  if (n < 8 || fly_u16(p + 2) != n - 8) return FLY_BAD_PAYLOAD;
  m->code = fly_u16(p);
  m->frame_id = fly_u32(p + 4);
  m->text_bytes = n - 8;
  m->text = (const char *)p + 8;
  return FLY_OK;
}

/* ---- writing: header and CRC around a payload that already lies at out + FLY_HEADER_BYTES ---- */

static inline void fly_put(uint8_t *p, uint64_t value, int bytes) {
  for (int k = 0; k < bytes; k++) p[k] = (uint8_t)(value >> 8 * k);
}
/* Tag and length of a field whose value lies behind them at p + FLY_FIELD_BYTES; the field's length. */
static inline size_t fly_put_field(uint8_t *p, uint16_t tag, uint16_t length) {
  fly_put(p, tag, 2);
  fly_put(p + 2, length, 2);
  return FLY_FIELD_BYTES + (size_t)length;
}
static inline size_t fly_seal(uint8_t *out, uint8_t type, uint64_t session_id, uint32_t sequence,
                              uint32_t payload_bytes) {
  size_t n = FLY_HEADER_BYTES + (size_t)payload_bytes;
  memcpy(out, "FLYA", 4);
  fly_put(out + 4, FLY_PROTOCOL_VERSION, 2);
  out[6] = type;
  out[7] = 0;
  fly_put(out + 8, session_id, 8);
  fly_put(out + 16, sequence, 4);
  fly_put(out + 20, payload_bytes, 4);
  fly_put(out + n, fly_crc32(out, n), 4);
  return n + FLY_CRC_BYTES;
}

#endif
