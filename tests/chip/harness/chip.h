// An ATmega328P at 16 MHz as an Arduino UNO has it, simulated by libsimavr: runs a firmware, reports five motors.

#pragma once

#include <stdbool.h>
#include <stdint.h>

enum { MOTORS = 5, CYCLES_PER_MS = 16000 };

// A byte that the chip has sent is on the line at `cycle`.
typedef void (*chip_said_t)(uint8_t byte, uint64_t cycle);

// A motor, 1 to 5, has had this duty since `cycle`; its pin was high for `high` cycles before.
typedef void (*chip_drove_t)(int motor, int duty, uint64_t cycle, uint64_t high);

// Loads a firmware (ELF) and starts it; `xbee` closes the jumper from D7 to ground. False if it cannot be read.
bool chip_start(const char *firmware, bool xbee, chip_said_t said, chip_drove_t drove);

// Runs until `cycle`; a chip without power lets the time pass.
void chip_run_until(uint64_t cycle);

uint64_t chip_cycle(void);

// Off: every pin floats, and the drivers' pull-downs stop the motors.
void chip_power(bool on);

// Resets; the firmware starts `boot_ms` later, as after a bootloader. What comes meanwhile is lost.
void chip_reset(uint32_t boot_ms);

// Makes the firmware loop for ever with interrupts off, as a bug would.
void chip_hang(void);

// Cycles that the simulated UART takes for one character; 0 while the chip is off, booting or deaf.
uint64_t chip_character(void);

// What the firmware has set the UART to.
uint32_t chip_baud(void);

// Starts a character towards the chip now.
void chip_hear(uint8_t byte);
