/* A board in C, written from docs/hil_protocol.md and docs/hil_protocol.h alone.
 *
 *   cc -std=c99 -Wall -Werror -O2 -I docs examples/board_c/board.c -o board -lm
 *   ./board 127.0.0.1 5600
 *   ./board /dev/ttyS0 921600
 *
 * It takes Mono8 images as they are, over TCP or a serial line, and answers where the bright pixels lie as seen by the camera, at a
 * range of 10 m: no estimator, but all that a host sees of one. Put yours in place of look().
 * Exit code 0: the host said goodbye; 1: it vanished; 2: a mistake, in one sentence. MIT licence, as the rest.
 */
#define _POSIX_C_SOURCE 200809L
#define _DEFAULT_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <netdb.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "hil_protocol.h"

#define BUFFER_BYTES (2u * (FLY_MAX_PAYLOAD_BYTES + 64u))
#define LARGEST_IMAGE (64u << 20)
#define SERIAL_BYTES (1u << 17) /* chunks are 2 KiB there, HELLO_ACK may be 64 */
#define SILENCE_S 10            /* a host that says nothing for so long is gone */

enum { GOODBYE = 0, VANISHED = 1, MISTAKE = 2 };

static int line, on_serial;
static uint64_t session_id;
static uint32_t sequence;
static uint32_t newest_frame = FLY_NO_FRAME;
static struct fly_hello_ack terms;
static double fx_px, fy_px, cx_px, cy_px;

/* the frame that is coming in */
static struct fly_frame_header frame;
static uint32_t chunks_here;
static int in_frame;
static uint8_t *image;

static uint64_t now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

static void put_f64(uint8_t *p, double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  fly_put(p, bits, 8);
}

/* ---- sending: the payload lies at packet + 4 + FLY_HEADER_BYTES, behind room for length and header ---- */

static uint8_t packet[4096];
static uint8_t *const payload = packet + 4 + FLY_HEADER_BYTES;

static void say(uint8_t type, uint32_t bytes) {
  static uint8_t stuffed[sizeof packet + sizeof packet / 254 + 4];
  size_t n = fly_seal(packet + 4, type, session_id, sequence++, bytes), sent = 0;
  const uint8_t *told = packet;
  fly_put(packet, n, 4);
  n += 4;
  if (on_serial) { /* between zeros, the first of which ends whatever garbage went before */
    n = fly_cobs_encode(stuffed + 1, packet + 4, n - 4) + 2;
    stuffed[0] = stuffed[n - 1] = 0;
    told = stuffed;
  }
  while (sent < n) {
    ssize_t k = write(line, told + sent, n - sent);
    if (k <= 0) return; /* the next read says that the line is gone */
    sent += (size_t)k;
  }
}

static void say_hello(void) {
  memset(payload, 0, 200);
  fly_put(payload, FLY_PROTOCOL_VERSION, 2);
  fly_put(payload + 2, 1u << FLY_RAW | FLY_TAKES_FIELDS, 2);
  fly_put(payload + 4, 1, 2); /* it works on one frame at a time */
  fly_put(payload + 6, FLY_TAKES_MONO8, 2);
  memcpy(payload + 104, "centroid", 8);
  memcpy(payload + 136, "example board in C", 18);
  say(FLY_HELLO, 200);
}

static void say_error(unsigned code, uint32_t frame_id, const char *text) {
  size_t n = strlen(text);
  fly_put(payload, code, 2);
  fly_put(payload + 2, n, 2);
  fly_put(payload + 4, frame_id, 4);
  memcpy(payload + 8, text, n);
  say(FLY_ERROR, 8 + (uint32_t)n);
}

static void lose_frame(void) {
  if (in_frame) say_error(FLY_INCOMPLETE, frame.frame_id, "a packet of the frame was lost");
  in_frame = 0;
}

/* ---- the estimator's place ---- */

/* Direction of the pixels that are brighter than half the brightest; whether there are any. */
static int look(const uint8_t *pixels, unsigned width, unsigned height, double t_m[3]) {
  double sum = 0.0, x = 0.0, y = 0.0;
  unsigned brightest = 0;
  for (size_t k = 0; k < (size_t)width * height; k++)
    if (pixels[k] > brightest) brightest = pixels[k];
  if (brightest < 16) return 0;
  for (unsigned row = 0; row < height; row++)
    for (unsigned column = 0; column < width; column++)
      if (2u * pixels[(size_t)row * width + column] > brightest) {
        sum += 1.0;
        x += column;
        y += row;
      }
  t_m[2] = 10.0;
  t_m[0] = (x / sum - cx_px) / fx_px * t_m[2];
  t_m[1] = (y / sum - cy_px) / fy_px * t_m[2];
  return 1;
}

static void answer(uint64_t received_ns) {
  static const char dark[] = "nothing bright in the picture";
  uint64_t start_ns = now_ns();
  double t_m[3] = {0.0, 0.0, 0.0};
  int seen = look(image, frame.width_px, frame.height_px, t_m);
  uint64_t end_ns = now_ns();
  uint32_t reason_bytes = seen ? 0 : (uint32_t)sizeof dark - 1;
  uint8_t *stage = payload + 100, *reason = stage + FLY_STAGE_BYTES;
  memset(payload, 0, 100 + FLY_STAGE_BYTES);
  fly_put(payload, frame.frame_id, 4);
  payload[4] = payload[5] = (uint8_t)seen; /* accepted, has a pose */
  fly_put(payload + 6, 1, 2);
  put_f64(payload + 8, 0.0);         /* confidence: it has none */
  put_f64(payload + 16, (double)seen); /* q = 1 0 0 0; zeros without a pose */
  for (int k = 0; k < 3; k++) put_f64(payload + 48 + 8 * k, t_m[k]);
  fly_put(payload + 72, received_ns, 8);
  fly_put(payload + 80, start_ns, 8);
  fly_put(payload + 88, end_ns, 8);
  fly_put(payload + 96, reason_bytes, 2);
  memcpy(stage, "centroid", 8);
  put_f64(stage + FLY_STAGE_NAME_BYTES, 1e-6 * (double)(end_ns - start_ns));
  memcpy(reason, dark, reason_bytes);
  say(FLY_POSE, 100 + FLY_STAGE_BYTES + reason_bytes);
  fly_put(payload, frame.frame_id, 4);
  fly_put(payload + 4, terms.window, 2);
  fly_put(payload + 6, 0, 2);
  say(FLY_CREDIT, 8);
}

/* ---- hearing ---- */

/* A number of the camera's JSON object; NAN where it is not there. */
static double number(const char *json, const char *name) {
  const char *at = strstr(json, name);
  return at == NULL || (at = strchr(at, ':')) == NULL ? NAN : strtod(at + 1, NULL);
}

static int take_terms(const struct fly_packet *p) {
  char *json;
  if (fly_read_hello_ack(&terms, p->payload, p->payload_bytes) != FLY_OK) return 0;
  if (terms.pixel_format != FLY_MONO8 || terms.encoding != FLY_RAW || !terms.width_px || !terms.height_px ||
      (size_t)terms.width_px * terms.height_px > LARGEST_IMAGE) {
    say_error(FLY_FORMAT, FLY_NO_FRAME, "this board takes raw Mono8 images up to 64 MiB alone");
    return 0;
  }
  json = calloc(terms.camera_bytes + 1, 1);
  image = malloc((size_t)terms.width_px * terms.height_px);
  if (json == NULL || image == NULL) return 0;
  memcpy(json, terms.camera_json, terms.camera_bytes);
  fx_px = number(json, "\"fx_px\"");
  fy_px = number(json, "\"fy_px\"");
  cx_px = number(json, "\"cx_px\"");
  cy_px = number(json, "\"cy_px\"");
  free(json);
  session_id = p->session_id;
  return fx_px > 0.0 && fy_px > 0.0 && !isnan(cx_px) && !isnan(cy_px);
}

static void take_header(const struct fly_packet *p) {
  struct fly_frame_header next;
  if (fly_read_frame_header(&next, p->payload, p->payload_bytes) != FLY_OK) {
    say_error(FLY_OTHER, FLY_NO_FRAME, "a FRAME_HEADER of another length");
    return;
  }
  /* ids grow: one that does not is of a packet that came twice */
  if ((newest_frame != FLY_NO_FRAME && next.frame_id <= newest_frame) || (in_frame && next.frame_id == frame.frame_id))
    return;
  lose_frame(); /* one that is still coming in will not become whole */
  frame = next;
  if (frame.width_px != terms.width_px || frame.height_px != terms.height_px || frame.pixel_format != FLY_MONO8 ||
      frame.encoding != FLY_RAW || frame.total_bytes != (uint32_t)frame.width_px * frame.height_px ||
      frame.transfer != FLY_LINEAR || frame.chunk_count == 0) {
    say_error(FLY_FORMAT, frame.frame_id, "a frame of another size or format than agreed");
    return;
  }
  in_frame = 1;
  chunks_here = 0;
}

static void take_chunk(const struct fly_packet *p, uint64_t received_ns) {
  struct fly_frame_chunk chunk;
  if (fly_read_frame_chunk(&chunk, p->payload, p->payload_bytes) != FLY_OK) {
    say_error(FLY_OTHER, FLY_NO_FRAME, "a FRAME_CHUNK of another length");
    return;
  }
  if (!in_frame || chunk.frame_id != frame.frame_id) return; /* the rest of one that was lost */
  if (chunk.index < chunks_here) return; /* it came twice */
  if (chunk.index > chunks_here) {
    lose_frame();
    return;
  }
  if (chunk.offset > frame.total_bytes || chunk.data_bytes > frame.total_bytes - chunk.offset) {
    in_frame = 0;
    say_error(FLY_FORMAT, frame.frame_id, "a chunk that lies outside its image");
    return;
  }
  memcpy(image + chunk.offset, chunk.data, chunk.data_bytes);
  if (++chunks_here < frame.chunk_count) return;
  in_frame = 0;
  newest_frame = frame.frame_id;
  answer(received_ns);
}

/* The exit code, or -1 to go on. */
static int take(const struct fly_packet *p) {
  uint64_t at_ns = now_ns();
  struct fly_time_sync clocks;
  struct fly_tail tail;
  if (p->type == FLY_ERROR && fly_read_error(&tail, p->payload, p->payload_bytes) == FLY_OK) {
    if (tail.code == FLY_CORRUPT && image != NULL) return -1;
    fprintf(stderr, "the host ended the session: %.*s\n", (int)tail.text_bytes, tail.text);
    return image == NULL ? MISTAKE : VANISHED;
  }
  if (image == NULL) {
    if (p->type == FLY_HELLO_ACK && !take_terms(p)) {
      fprintf(stderr, "the host's terms cannot be kept\n");
      return MISTAKE;
    }
    return -1;
  }
  if (p->session_id != session_id) return -1; /* of an earlier session */
  switch (p->type) {
    case FLY_TIME_SYNC_REQUEST:
      if (fly_read_time_sync_request(&clocks, p->payload, p->payload_bytes) != FLY_OK) break;
      fly_put(payload, clocks.asked_ns, 8);
      fly_put(payload + 8, at_ns, 8);
      fly_put(payload + 16, now_ns(), 8);
      fly_put(payload + 24, newest_frame, 4);
      fly_put(payload + 28, 1, 4);
      say(FLY_TIME_SYNC_REPLY, 32);
      break;
    case FLY_FRAME_HEADER: take_header(p); break;
    case FLY_FRAME_CHUNK: take_chunk(p, at_ns); break;
    case FLY_BYE:
      if (fly_read_bye(&tail, p->payload, p->payload_bytes) == FLY_OK)
        printf("the host ended the session: %.*s\n", (int)tail.text_bytes, tail.text);
      return GOODBYE;
    default: break; /* nothing that a board is meant to hear */
  }
  return -1;
}

/* A packet that fly_parse looked at; the exit code, or -1 to go on. */
static int judge(int status, const struct fly_packet *p) {
  if (status == FLY_OK) return take(p);
  if (status == FLY_BAD_VERSION) {
    say_error(FLY_VERSION, FLY_NO_FRAME, "this board speaks another version of the protocol");
    fprintf(stderr, "the host speaks protocol %u, this board %u\n", (unsigned)p->version, FLY_PROTOCOL_VERSION);
    return MISTAKE;
  }
  if (in_frame)
    lose_frame();
  else if (image != NULL)
    say_error(FLY_CORRUPT, FLY_NO_FRAME, "a packet was damaged");
  return -1;
}

static int vanished(void) {
  fprintf(stderr, "the host went away without a goodbye\n");
  return VANISHED;
}

/* Whether a packet may begin here: length prefix, magic and header agree. */
static int may_begin(const uint8_t *p) {
  uint32_t n = fly_u32(p), inside = fly_u32(p + 4 + 20);
  return inside <= FLY_MAX_PAYLOAD_BYTES && n == inside + FLY_HEADER_BYTES + FLY_CRC_BYTES &&
         memcmp(p + 4, "FLYA", 4) == 0;
}

static int serve_tcp(void) {
  static uint8_t buffer[BUFFER_BYTES];
  size_t from = 0, to = 0;
  for (;;) {
    ssize_t got;
    while (to - from >= 4 + FLY_HEADER_BYTES) {
      struct fly_packet p;
      uint32_t n = fly_u32(buffer + from);
      int status, code;
      if (!may_begin(buffer + from)) {
        from++; /* out of step: look on */
        continue;
      }
      if (to - from < 4 + (size_t)n) break;
      status = fly_parse(&p, buffer + from + 4, n);
      /* its length may be what is damaged: others may lie inside */
      from += status == FLY_OK || status == FLY_BAD_VERSION ? 4 + (size_t)n : 5;
      code = judge(status, &p);
      if (code >= 0) return code;
    }
    memmove(buffer, buffer + from, to - from);
    to -= from;
    from = 0;
    got = recv(line, buffer + to, BUFFER_BYTES - to, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return vanished();
    to += (size_t)got;
  }
}

static int serve_serial(void) {
  static uint8_t frame_bytes[SERIAL_BYTES], bytes[4096];
  struct fly_serial in = {frame_bytes, sizeof frame_bytes, 0};
  struct pollfd waits = {line, POLLIN, 0};
  for (int silent_s = 0;;) {
    struct fly_packet p;
    ssize_t got;
    int ready = poll(&waits, 1, 1000);
    if (ready == 0) {
      if (image == NULL)
        say_hello(); /* it may have been lost, or nobody was there */
      else if (++silent_s >= SILENCE_S)
        return vanished();
      continue;
    }
    got = read(line, bytes, sizeof bytes);
    if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (got <= 0) return vanished();
    silent_s = 0;
    for (ssize_t k = 0; k < got; k++) {
      size_t n = fly_serial_take(&in, bytes[k]);
      int code = n ? judge(fly_parse(&p, frame_bytes, n), &p) : -1;
      if (code >= 0) return code;
    }
  }
}

static int open_tcp(const char *host, const char *port) {
  struct addrinfo hints = {0}, *found = NULL;
  int opened;
  hints.ai_socktype = SOCK_STREAM;
  if (getaddrinfo(host, port, &hints, &found) != 0) return -1;
  opened = socket(found->ai_family, found->ai_socktype, found->ai_protocol);
  if (opened >= 0 && connect(opened, found->ai_addr, found->ai_addrlen) != 0) {
    close(opened);
    opened = -1;
  }
  freeaddrinfo(found);
  return opened;
}

static int open_serial(const char *device, const char *baud) {
  static const struct {
    long baud;
    speed_t speed;
  } rates[] = {{115200, B115200}, {230400, B230400}, {460800, B460800}, {921600, B921600},
#ifdef B3000000
               {1000000, B1000000}, {2000000, B2000000}, {3000000, B3000000},
#endif
  };
  struct termios how;
  int opened = open(device, O_RDWR | O_NOCTTY);
  if (opened < 0 || tcgetattr(opened, &how) != 0) return -1;
  cfmakeraw(&how);
  how.c_cflag |= CLOCAL | CREAD;
  for (size_t k = 0; k < sizeof rates / sizeof rates[0]; k++)
    if (rates[k].baud == atol(baud) && cfsetspeed(&how, rates[k].speed) == 0 && tcsetattr(opened, TCSANOW, &how) == 0)
      return opened;
  close(opened);
  return -1;
}

int main(int argc, char **argv) {
  int code;
  if (argc != 3) {
    fprintf(stderr, "usage: board HOST PORT, or board /dev/DEVICE BAUD\n");
    return MISTAKE;
  }
  signal(SIGPIPE, SIG_IGN);
  on_serial = argv[1][0] == '/';
  line = on_serial ? open_serial(argv[1], argv[2]) : open_tcp(argv[1], argv[2]);
  if (line < 0) {
    fprintf(stderr, "no host on %s, %s: start it first, or check the device and its rate\n", argv[1], argv[2]);
    return MISTAKE;
  }
  say_hello();
  code = on_serial ? serve_serial() : serve_tcp();
  close(line);
  free(image);
  return code;
}
