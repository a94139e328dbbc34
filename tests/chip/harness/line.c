#define _GNU_SOURCE
#include "line.h"

#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

static int master = -1;
static bool open_before, opened, is_cut;
static const char *link_path;
static double noise;
static uint64_t chance;
static struct {
  uint8_t bytes[65536];
  size_t head, size;
} heard;

// xorshift64*: the same seed makes the same noise everywhere.
static uint32_t draw(void) {
  chance ^= chance >> 12;
  chance ^= chance << 25;
  chance ^= chance >> 27;
  return (chance * 0x2545F4914F6CDD1DULL) >> 32;
}

static bool happens(double probability) { return draw() < probability * 4294967296.0; }

static uint32_t host_baud(void) {
  static const struct {
    speed_t code;
    uint32_t baud;
  } kSpeeds[] = {{B9600, 9600}, {B19200, 19200}, {B38400, 38400}, {B57600, 57600}, {B115200, 115200}};
  struct termios settings;
  if (tcgetattr(master, &settings) != 0) return 0;
  for (unsigned k = 0; k < sizeof kSpeeds / sizeof *kSpeeds; ++k) {
    if (kSpeeds[k].code == cfgetospeed(&settings)) return kSpeeds[k].baud;
  }
  return 0;
}

// Beyond 4.5 % a receiver samples the wrong bits (ATmega328P datasheet, table 19-2).
static bool garbled(uint32_t baud) {
  const double ratio = baud / (double)host_baud();
  return !(ratio > 0.955 && ratio < 1.045);
}

// Puts a byte through the line: returns how many arrive.
static int pass(uint8_t *byte, uint32_t baud) {
  if (is_cut) return 0;
  if (garbled(baud)) *byte = *byte * 0x1D ^ 0xA5;
  if (!happens(noise)) return 1;
  switch (draw() % 3) {
    case 0:
      *byte ^= 1 + draw() % 255;
      return 1;
    case 1:
      return 0;
    default:
      return 2;
  }
}

// Opened and closed once, a pseudo-terminal tells whether a host holds it: it hangs up while none does.
static bool prepare(const char *slave) {
  const int host = open(slave, O_RDWR | O_NOCTTY);
  struct termios settings;
  if (host < 0 || tcgetattr(host, &settings) != 0) return false;
  cfmakeraw(&settings);
  const bool ready = tcsetattr(host, TCSANOW, &settings) == 0;
  close(host);
  return ready;
}

bool line_plug(const char *path, line_options_t options) {
  if (!link_path) chance = options.seed + 0x9E3779B97F4A7C15ULL;
  noise = options.noise;
  link_path = path;
  master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) return false;
  const char *slave = ptsname(master);
  if (!slave || !prepare(slave)) return false;
  open_before = opened = false;
  unlink(path);
  return symlink(slave, path) == 0;
}

void line_unplug(void) {
  if (master < 0) return;
  unlink(link_path);
  close(master);
  master = -1;
  line_flush();
}

void line_cut(bool cut) { is_cut = cut; }

void line_flush(void) { heard.size = 0; }

void line_hear(uint8_t byte) {
  if (heard.size < sizeof heard.bytes) heard.bytes[(heard.head + heard.size++) % sizeof heard.bytes] = byte;
}

static void read_host(void) {
  uint8_t chunk[4096];
  const ssize_t size = read(master, chunk, sizeof chunk);
  for (ssize_t k = 0; k < size; ++k) line_hear(chunk[k]);
}

void line_wait(int timeout_us) {
  struct pollfd watched = {.fd = master, .events = POLLIN};
  const struct timespec timeout = {.tv_nsec = 1000L * timeout_us};
  // A hung-up terminal is ready at once, for ever: poll it without waiting, then sleep.
  if (master >= 0 && !open_before) {
    poll(&watched, 1, 0);
    nanosleep(&timeout, NULL);
  } else if (master >= 0) {
    ppoll(&watched, 1, &timeout, NULL);
  } else {
    nanosleep(&timeout, NULL);
    return;
  }
  const bool open_now = !(watched.revents & POLLHUP);
  opened = opened || (open_now && !open_before);
  open_before = open_now;
  if (watched.revents & POLLIN) read_host();
}

bool line_opened(void) {
  const bool result = opened;
  opened = false;
  return result;
}

bool line_take(uint8_t *byte, uint32_t baud) {
  static int doubled;
  static uint8_t again;
  if (doubled) {
    doubled = 0;
    *byte = again;
    return true;
  }
  while (heard.size) {
    *byte = heard.bytes[heard.head];
    heard.head = (heard.head + 1) % sizeof heard.bytes;
    --heard.size;
    const int arrive = pass(byte, baud);
    if (arrive == 0) continue;
    doubled = arrive == 2;
    again = *byte;
    return true;
  }
  return false;
}

void line_give(uint8_t byte, uint32_t baud) {
  if (master < 0) return;
  for (int arrive = pass(&byte, baud); arrive > 0; --arrive) {
    if (write(master, &byte, 1) != 1) return;
  }
}
