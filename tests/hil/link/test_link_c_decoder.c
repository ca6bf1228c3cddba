/* Reads packets in hexadecimal from stdin, one a line, prints one line of fields for each. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "hil_protocol.h"

static void hex(const char *name, const uint8_t *p, size_t n) {
  printf(" %s=", name);
  while (n--) printf("%02x", *p++);
}
static void text(const char *name, const char *p, size_t n) { hex(name, (const uint8_t *)p, n); }
static void string(const char *name, const char *p) { text(name, p, strlen(p)); }
#define U(name, value) printf(" %s=%" PRIu64, name, (uint64_t)(value))
#define F(name, value) printf(" %s=%.17g", name, value)

static int show(const struct fly_packet *k) {
  const uint8_t *p = k->payload;
  uint32_t n = k->payload_bytes;
  int status = FLY_BAD_PAYLOAD;
  if (k->type == FLY_HELLO) {
    struct fly_hello m;
    status = fly_read_hello(&m, p, n);
    U("encodings", m.encodings), U("window", m.window), U("pixel_formats", m.pixel_formats);
    U("takes_fields", m.takes_fields);
    string("model_name", m.model_name), string("method", m.method), string("board", m.board);
    hex("model_sha256", m.model_sha256, 32);
  } else if (k->type == FLY_HELLO_ACK) {
    struct fly_hello_ack m;
    status = fly_read_hello_ack(&m, p, n);
    U("width_px", m.width_px), U("height_px", m.height_px), U("bits", m.bits), U("encoding", m.encoding);
    U("pixel_format", m.pixel_format), U("mode", m.mode), U("truth", m.truth), U("window", m.window), U("chunk_bytes", m.chunk_bytes);
    U("takes_fields", m.takes_fields);
    string("target_name", m.target_name), hex("target_sha256", m.target_sha256, 32);
    text("camera", m.camera_json, m.camera_bytes);
  } else if (k->type == FLY_TIME_SYNC_REQUEST || k->type == FLY_TIME_SYNC_REPLY) {
    struct fly_time_sync m;
    int reply = k->type == FLY_TIME_SYNC_REPLY;
    status = reply ? fly_read_time_sync_reply(&m, p, n) : fly_read_time_sync_request(&m, p, n);
    U("asked_ns", m.asked_ns);
    if (reply) U("received_ns", m.received_ns), U("sent_ns", m.sent_ns), U("newest_frame", m.newest_frame);
  } else if (k->type == FLY_FRAME_HEADER) {
    struct fly_frame_header m;
    status = fly_read_frame_header(&m, p, n);
    U("frame_id", m.frame_id), U("width_px", m.width_px), U("height_px", m.height_px), U("bits", m.bits);
    U("encoding", m.encoding), U("total_bytes", m.total_bytes), U("chunk_count", m.chunk_count);
    F("exposure_s", m.exposure_s), F("t_s", m.t_s), U("host_send_ns", m.host_send_ns);
    U("pixel_format", m.pixel_format), U("binning_x", m.binning_x), U("binning_y", m.binning_y);
    U("roi", m.roi_x_px), U("roi", m.roi_y_px), U("roi", m.roi_width_px), U("roi", m.roi_height_px);
    U("camera_frame", m.camera_frame), U("exposure_start_ns", m.exposure_start_ns);
    U("exposure_end_ns", m.exposure_end_ns);
    string("epoch_utc", m.epoch_utc);
    U("transfer", m.transfer), U("has_sun", m.has_sun);
    for (int i = 0; i < 3; i++) F("sun", m.sun_camera[i]);
  } else if (k->type == FLY_FRAME_CHUNK) {
    struct fly_frame_chunk m;
    status = fly_read_frame_chunk(&m, p, n);
    U("frame_id", m.frame_id), U("index", m.index), U("offset", m.offset);
    hex("data", m.data, m.data_bytes);
  } else if (k->type == FLY_POSE) {
    struct fly_pose m;
    status = fly_read_pose(&m, p, n);
    U("frame_id", m.frame_id), U("accepted", m.accepted), U("has_pose", m.has_pose);
    F("confidence", m.confidence);
    for (int i = 0; i < 4; i++) F("q", m.q_camera_from_target_wxyz[i]);
    for (int i = 0; i < 3; i++) F("t", m.t_camera_from_target_m[i]);
    U("receive_ns", m.receive_ns), U("start_ns", m.start_ns), U("end_ns", m.end_ns);
    for (unsigned i = 0; i < m.stage_count; i++) {
      char name[25];
      double ms;
      fly_read_stage(name, &ms, &m, i);
      string("stage", name), F("ms", ms);
    }
    text("reason", m.reason, m.reason_bytes);
    U("has_covariance", m.has_covariance);
    for (int i = 0; i < 21; i++) F("covariance", (double)m.covariance[i]);
  } else if (k->type == FLY_CREDIT) {
    struct fly_credit m;
    status = fly_read_credit(&m, p, n);
    U("frame_id", m.frame_id), U("window", m.window);
  } else if (k->type == FLY_TRUTH || k->type == FLY_BYE || k->type == FLY_ERROR) {
    struct fly_tail m;
    status = k->type == FLY_TRUTH ? fly_read_truth(&m, p, n)
             : k->type == FLY_BYE ? fly_read_bye(&m, p, n)
                                  : fly_read_error(&m, p, n);
    if (k->type != FLY_BYE) U("frame_id", m.frame_id);
    if (k->type == FLY_ERROR) U("code", m.code);
    text(k->type == FLY_TRUTH ? "truth" : k->type == FLY_BYE ? "reason" : "text", m.text, m.text_bytes);
  }
  return status;
}

int main(void) {
  static char line[1 << 16];
  static uint8_t in[1 << 15], data[1 << 15], again[1 << 15];
  while (fgets(line, sizeof line, stdin)) {
    size_t n = 0;
    for (const char *c = line; c[0] && c[0] != '\n'; c += 2) {
      char pair[3] = {c[0], c[1], 0};
      in[n++] = (uint8_t)strtoul(pair, NULL, 16);
    }
    if (n > 2 && in[0] == 0) /* a serial frame between its delimiters */
      n = fly_cobs_decode(data, in + 1, n - 2);
    else
      memcpy(data, in, n);
    struct fly_packet packet;
    int status = fly_parse(&packet, data, n);
    printf("status=%d", status);
    if (status == FLY_OK) {
      printf(" type=%u session=%016" PRIx64 " sequence=%u", packet.type, packet.session_id, packet.sequence);
      status = show(&packet);
      memcpy(again + FLY_HEADER_BYTES, packet.payload, packet.payload_bytes);
      size_t m = fly_seal(again, packet.type, packet.session_id, packet.sequence, packet.payload_bytes);
      printf(" payload_status=%d resealed=%d", status, m == n && memcmp(again, data, n) == 0);
    }
    printf("\n");
  }
  return 0;
}
