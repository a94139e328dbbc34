// The serial line as the host sees it: a pseudo-terminal under a name of its own, which may be noisy, cut or gone.

#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// One byte in `noise` is changed, lost or doubled, in either direction.
typedef struct {
  double noise;
  uint64_t seed;
} line_options_t;

// Opens a pseudo-terminal and links it to `path`.
bool line_plug(const char *path, line_options_t options);

// Takes a byte as if the host had sent it.
void line_hear(uint8_t byte);

// Removes the link and hangs up.
void line_unplug(void);

// A cut line loses everything, in both directions, and looks healthy.
void line_cut(bool cut);

// Waits up to `timeout_us` for bytes from the host; returns at once without a plug.
void line_wait(int timeout_us);

// Whether a host has opened the port since the last call.
bool line_opened(void);

// Takes the next byte from the host, as it arrives at `baud`.
bool line_take(uint8_t *byte, uint32_t baud);

// Drops what the host has sent and nobody took.
void line_flush(void);

// Gives the host a byte that was sent at `baud`.
void line_give(uint8_t byte, uint32_t baud);
