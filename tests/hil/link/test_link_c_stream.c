/* Reads a serial line from a device or stdin until BYE or the end; of each frame it prints "status packet", the packet
 * stuffed again, in hexadecimal. */
#define _DEFAULT_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <termios.h>
#include <unistd.h>

#include "hil_protocol.h"

int main(int argc, char **argv) {
  static uint8_t buffer[1 << 16], bytes[4096], stuffed[sizeof buffer + sizeof buffer / 254 + 1];
  struct fly_serial line = {buffer, sizeof buffer, 0};
  ssize_t got;
  int from = STDIN_FILENO;
  if (argc > 1) {
    struct termios how;
    from = open(argv[1], O_RDONLY | O_NOCTTY);
    if (from < 0 || tcgetattr(from, &how) != 0) return 2;
    cfmakeraw(&how);
    tcsetattr(from, TCSANOW, &how);
    puts("ready");
    fflush(stdout);
  }
  while ((got = read(from, bytes, sizeof bytes)) > 0)
    for (ssize_t k = 0; k < got; k++) {
      struct fly_packet p;
      size_t n = fly_serial_take(&line, bytes[k]);
      int status;
      if (n == 0) continue;
      status = fly_parse(&p, buffer, n);
      printf("%d ", status);
      if (status == FLY_OK) {
        size_t m = fly_cobs_encode(stuffed, buffer, n);
        for (size_t i = 0; i < m; i++) printf("%02x", stuffed[i]);
        if (p.type == FLY_BYE) {
          putchar('\n');
          return 0;
        }
      }
      putchar('\n');
    }
  return 0;
}
