// A simulated Arduino UNO on a pseudo-terminal, in real time.
//
//   simulated_uno FIRMWARE.elf PATH [--xbee] [--boot-ms MS] [--noise P] [--seed N]
//
// Says on standard output, one JSON object per line, with the simulated cycle (16 per microsecond):
//   {"event": "ready", "cycle": n, "path": "..."}          the firmware listens
//   {"event": "motor", "cycle": n, "motor": 1..5, "duty": 0..255, "high": m}   high: cycles the pin was high so far
//   {"event": "heard", "cycle": n}                        the last stop bit of a frame's end (a 0 after other bytes)
//   {"event": "said", "cycle": n}                         the same of a frame to the host
//   {"event": "done", "cycle": n, "command": "..."}
// Obeys on standard input: unplug, plug (the plug carries the power), cut, join (the line only), reset, hang, quit,
//   repeat PERIOD_MS LENGTH_MS HEX[,HEX...]   hears these bytes, one piece per period, in turn, as fast as it can:
//                                             nobody waits for the wall clock, or is told of frames, until then
// With --boot-ms, opening the port resets the chip, as DTR does, and the bootloader takes that long.

#define _GNU_SOURCE
#include <fcntl.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "chip.h"
#include "line.h"

// Between characters the chip gets 10 us to read the one before: simavr delays the next by what it takes.
enum { SLICE = CYCLES_PER_MS / 2, MOST_LAG_MS = 100, LONGEST_START_MS = 1000, REST = 160, LONGEST_COMMAND = 16384 };

static FILE *events;
static const char *path;
static line_options_t options = {.seed = 1};
static uint32_t boot_ms;
static uint64_t next_character;
static struct {
  uint64_t period, next, end;  // cycles
  const char *all, *at;        // hexadecimal pieces, and where the next one begins
} repeated;

static bool repeating(void) { return chip_cycle() < repeated.end; }

static void tell(const char *event, uint64_t cycle) {
  fprintf(events, "{\"event\": \"%s\", \"cycle\": %llu}\n", event, (unsigned long long)cycle);
}

static void drove(int motor, int duty, uint64_t cycle, uint64_t high) {
  fprintf(events, "{\"event\": \"motor\", \"cycle\": %llu, \"motor\": %d, \"duty\": %d, \"high\": %llu}\n",
          (unsigned long long)cycle, motor, duty, (unsigned long long)high);
}

static void said(uint8_t byte, uint64_t cycle) {
  static uint8_t before;
  if (byte == 0 && before != 0 && !repeating()) tell("said", cycle);
  before = byte;
  line_give(byte, chip_baud());
}

// Feeds the chip up to `end`, each character when the one before is over.
static void run_slice(uint64_t end) {
  static uint8_t before;
  uint8_t byte;
  while (chip_cycle() < end) {
    const uint64_t character = chip_character();
    if (character == 0) line_flush();
    if (character != 0 && chip_cycle() >= next_character && line_take(&byte, chip_baud())) {
      chip_hear(byte);
      next_character = chip_cycle() + character + REST;
      if (byte == 0 && before != 0 && !repeating()) tell("heard", chip_cycle() + character);
      before = byte;
    }
    chip_run_until(next_character > chip_cycle() && next_character < end ? next_character : end);
  }
}

static void plug(void) {
  if (!line_plug(path, options)) {
    perror("no pseudo-terminal");
    exit(2);
  }
}

// Puts the next piece on the line.
static void repeat(void) {
  unsigned byte;
  int size;
  for (; sscanf(repeated.at, "%2x%n", &byte, &size) == 1; repeated.at += size) line_hear(byte);
  repeated.at = *repeated.at == ',' ? repeated.at + 1 : repeated.all;
}

static void start_repeating(const char *command) {
  static char pieces[LONGEST_COMMAND];
  unsigned period_ms, length_ms;
  if (sscanf(command, "repeat %u %u %s", &period_ms, &length_ms, pieces) != 3) {
    fprintf(stderr, "expected repeat PERIOD_MS LENGTH_MS HEX[,HEX...], not %.80s\n", command);
    exit(2);
  }
  repeated.all = repeated.at = pieces;
  repeated.period = (uint64_t)period_ms * CYCLES_PER_MS;
  repeated.next = chip_cycle();
  repeated.end = repeated.next + (uint64_t)length_ms * CYCLES_PER_MS;
}

static void done(const char *command) {
  fprintf(events, "{\"event\": \"done\", \"cycle\": %llu, \"command\": \"%.*s\"}\n",
          (unsigned long long)chip_cycle(), (int)strcspn(command, " "), command);
}

static bool obey(const char *command) {
  if (strcmp(command, "quit") == 0) return false;
  if (strcmp(command, "unplug") == 0) {
    line_unplug();
    chip_power(false);
  } else if (strcmp(command, "plug") == 0) {
    plug();
    chip_power(true);
    chip_reset(boot_ms);
  } else if (strcmp(command, "cut") == 0 || strcmp(command, "join") == 0) {
    line_cut(*command == 'c');
  } else if (strcmp(command, "reset") == 0) {
    chip_reset(boot_ms);
  } else if (strcmp(command, "hang") == 0) {
    chip_hang();
  } else if (strncmp(command, "repeat ", 7) == 0) {
    start_repeating(command);
    return true;  // done when it is over
  } else {
    fprintf(stderr, "unknown command: %s\n", command);
    exit(2);
  }
  done(command);
  return true;
}

// Reads commands as they come; false at the last.
static bool commanded(void) {
  static char text[LONGEST_COMMAND];
  static size_t size;
  const ssize_t more = read(STDIN_FILENO, text + size, sizeof text - 1 - size);
  if (more == 0) return false;
  if (more > 0) size += more;
  text[size] = 0;
  for (char *end; (end = strchr(text, '\n'));) {
    *end = 0;
    if (!obey(text)) return false;
    size -= end + 1 - text;
    memmove(text, end + 1, size + 1);
  }
  return true;
}

// Runs on from `end` to the end of the repetition, and returns that.
static uint64_t hurry(uint64_t end) {
  for (; repeating(); end += SLICE) {
    if (end >= repeated.next) {
      repeated.next += repeated.period;
      repeat();
    }
    run_slice(end + SLICE);
  }
  done("repeat");
  return end;
}

static uint64_t now_us(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1000000ULL + now.tv_nsec / 1000;
}

static void start(void) {
  for (int ms = 1; chip_character() == 0; ++ms) {
    if (ms > LONGEST_START_MS) {
      fprintf(stderr, "the firmware has not started to listen in %d ms\n", LONGEST_START_MS);
      exit(3);
    }
    chip_run_until((uint64_t)ms * CYCLES_PER_MS);
  }
  fprintf(events, "{\"event\": \"ready\", \"cycle\": %llu, \"path\": \"%s\"}\n", (unsigned long long)chip_cycle(), path);
}

static void run(void) {
  const uint64_t first = chip_cycle();
  uint64_t started_us = now_us() - first / (CYCLES_PER_MS / 1000);
  for (uint64_t end = first + SLICE; commanded(); end += SLICE) {
    const uint64_t due_us = started_us + end / (CYCLES_PER_MS / 1000), now = now_us();
    // A machine that could not keep up is not made up for.
    if (now > due_us + MOST_LAG_MS * 1000) started_us += now - due_us;
    line_wait(now < due_us ? due_us - now : 0);
    if (line_opened() && boot_ms > 0) chip_reset(boot_ms);
    run_slice(end);
    if (!repeating()) continue;
    end = hurry(end);
    started_us = now_us() - end / (CYCLES_PER_MS / 1000);
  }
}

// libsimavr prints there too; events have it for themselves.
static void take_stdout(void) {
  events = fdopen(dup(STDOUT_FILENO), "w");
  if (!events || dup2(STDERR_FILENO, STDOUT_FILENO) < 0) {
    perror("standard output");
    exit(2);
  }
  setvbuf(events, NULL, _IOLBF, 0);
}

static bool parse(int count, char **words, bool *xbee) {
  static const struct option kOptions[] = {
      {"xbee", no_argument, NULL, 'x'},        {"boot-ms", required_argument, NULL, 'b'},
      {"noise", required_argument, NULL, 'n'}, {"seed", required_argument, NULL, 's'},
      {0}};
  for (int option; (option = getopt_long(count, words, "", kOptions, NULL)) != -1;) {
    if (option == 'x') *xbee = true;
    else if (option == 'b') boot_ms = strtoul(optarg, NULL, 10);
    else if (option == 'n') options.noise = strtod(optarg, NULL);
    else if (option == 's') options.seed = strtoull(optarg, NULL, 10);
    else return false;
  }
  return count - optind == 2;
}

int main(int count, char **words) {
  bool xbee = false;
  if (!parse(count, words, &xbee)) {
    fprintf(stderr, "usage: %s FIRMWARE.elf PATH [--xbee] [--boot-ms MS] [--noise P] [--seed N]\n", words[0]);
    return 2;
  }
  take_stdout();
  path = words[optind + 1];
  if (!chip_start(words[optind], xbee, said, drove)) {
    fprintf(stderr, "%s: no firmware for an ATmega328P\n", words[optind]);
    return 2;
  }
  plug();
  fcntl(STDIN_FILENO, F_SETFL, O_NONBLOCK);
  start();
  run();
  line_unplug();
  return 0;
}
