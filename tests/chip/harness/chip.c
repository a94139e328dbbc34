#include "chip.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_cycle_timers.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_io.h>

// Data addresses of the ATmega328P (datasheet, register summary).
enum {
  DDRB = 0x24, PORTB = 0x25, DDRD = 0x2A, PORTD = 0x2B,
  TCCR0A = 0x44, OCR0A = 0x47, OCR0B = 0x48,
  TCCR1A = 0x80, OCR1AL = 0x88, OCR1BL = 0x8A,
  TCCR2A = 0xB0, OCR2B = 0xB4,
  UCSR0A = 0xC0, UBRR0L = 0xC4, UBRR0H = 0xC5,
};
enum { COMA1 = 1 << 7, COMB1 = 1 << 5, U2X0 = 1 << 1, JUMPER = 7 };

// analogWrite() connects the pin before it sets the duty: shorter than this it is not meant, 20 us.
enum { GLITCH = 320, LONGEST_QUEUE = 256, SPIN = 0x7FFE };

typedef struct {
  char port;
  uint8_t bit;
  uint16_t control, connected, compare;
} pin_t;

static const pin_t kPins[MOTORS] = {
    {'D', 3, TCCR2A, COMB1, OCR2B},   // D3, thumb
    {'D', 5, TCCR0A, COMB1, OCR0B},   // D5
    {'D', 6, TCCR0A, COMA1, OCR0A},   // D6
    {'B', 1, TCCR1A, COMA1, OCR1AL},  // D9
    {'B', 2, TCCR1A, COMB1, OCR1BL},  // D10, little finger
};

typedef struct {
  int told, now;           // duty
  uint64_t since;          // cycle at which `now` began
  bool level;              // of the pin
  uint64_t level_since;
  uint64_t high, high_at;  // cycles for which the pin was high: in all, and until `since`
} motor_t;

static avr_t *avr;
static avr_uart_t *uart;
static motor_t motors[MOTORS];
static bool powered = true;
static uint64_t boots_at;
static chip_said_t on_said;
static chip_drove_t on_drove;
static struct {
  uint8_t bytes[LONGEST_QUEUE];
  unsigned head, size;
} saying;

static int duty_of(const pin_t *pin) {
  const uint8_t mask = 1 << pin->bit;
  const uint8_t *port = &avr->data[pin->port == 'B' ? PORTB : PORTD];
  const uint8_t *direction = &avr->data[pin->port == 'B' ? DDRB : DDRD];
  if (!powered || !(*direction & mask)) return 0;
  if (avr->data[pin->control] & pin->connected) return avr->data[pin->compare];
  return *port & mask ? 255 : 0;
}

static uint64_t high_until_now(const motor_t *motor) {
  return motor->high + (motor->level ? avr->cycle - motor->level_since : 0);
}

static void tell(int k) {
  motor_t *motor = &motors[k];
  if (motor->now == motor->told || avr->cycle - motor->since < GLITCH) return;
  motor->told = motor->now;
  on_drove(k + 1, motor->now, motor->since, motor->high_at);
}

static void look_at_motors(void) {
  for (int k = 0; k < MOTORS; ++k) {
    tell(k);
    const int duty = duty_of(&kPins[k]);
    if (duty == motors[k].now) continue;
    motors[k].now = duty;
    motors[k].since = avr->cycle;
    motors[k].high_at = high_until_now(&motors[k]);
  }
}

static void register_written(avr_irq_t *irq, uint32_t value, void *param) {
  (void)irq, (void)value, (void)param;
  look_at_motors();
}

static void pin_changed(avr_irq_t *irq, uint32_t value, void *param) {
  (void)irq;
  motor_t *motor = param;
  const bool level = value & 1;
  if (level == motor->level) return;
  motor->high = high_until_now(motor);
  motor->level = level;
  motor->level_since = avr->cycle;
}

static avr_cycle_count_t character_sent(avr_t *chip, avr_cycle_count_t when, void *param) {
  (void)chip, (void)param;
  const uint8_t byte = saying.bytes[saying.head];
  saying.head = (saying.head + 1) % LONGEST_QUEUE;
  --saying.size;
  on_said(byte, when);
  return saying.size ? when + uart->cycles_per_byte : 0;
}

static void character_started(avr_irq_t *irq, uint32_t value, void *param) {
  (void)irq, (void)param;
  if (saying.size == LONGEST_QUEUE) return;
  saying.bytes[(saying.head + saying.size++) % LONGEST_QUEUE] = value;
  if (saying.size == 1) avr_cycle_timer_register(avr, uart->cycles_per_byte, character_sent, NULL);
}

// simavr would pass sleeping time on to the operating system; the pace is kept elsewhere.
static void sleep_without_waiting(avr_t *chip, avr_cycle_count_t cycles) { (void)chip, (void)cycles; }

static void watch(uint16_t address) {
  avr_irq_register_notify(avr_iomem_getirq(avr, address, NULL, AVR_IOMEM_IRQ_ALL), register_written, NULL);
}

// An unfiltered pin tells its level even if it had the same before a reset, which simavr does not notice.
static avr_irq_t *pin_of(char port, int bit) {
  avr_irq_t *pin = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(port), bit);
  pin->flags &= ~IRQ_FLAG_FILTERED;
  return pin;
}

static void watch_motors(void) {
  const uint16_t registers[] = {DDRB, PORTB, DDRD, PORTD, TCCR0A, OCR0A, OCR0B, TCCR1A, OCR1AL, OCR1BL, TCCR2A, OCR2B};
  for (unsigned k = 0; k < sizeof registers / sizeof *registers; ++k) watch(registers[k]);
  for (int k = 0; k < MOTORS; ++k) {
    avr_irq_register_notify(pin_of(kPins[k].port, kPins[k].bit), pin_changed, &motors[k]);
  }
}

static void find_uart(void) {
  for (avr_io_t *io = avr->io_port; io && !uart; io = io->next) {
    if (strcmp(io->kind, "uart") == 0) uart = (avr_uart_t *)io;
  }
  uint32_t quiet = 0;
  avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &quiet);
  avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), character_started, NULL);
}

// A low INT0 or INT1 pin, and D3 is INT1, would be polled in almost every cycle.
static void reset(void) {
  avr_reset(avr);
  avr_extint_set_strict_lvl_trig(avr, 0, 0);
  avr_extint_set_strict_lvl_trig(avr, 1, 0);
  saying.size = 0;
  for (int k = 0; k < MOTORS; ++k) pin_changed(NULL, 0, &motors[k]);
  look_at_motors();
}

static void set_jumper(bool closed) {
  avr_ioport_external_t pull = {.name = 'D', .mask = 1 << JUMPER, .value = !closed << JUMPER};
  avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &pull);
  pin_of('D', JUMPER);
}

bool chip_start(const char *firmware, bool xbee, chip_said_t said, chip_drove_t drove) {
  static elf_firmware_t program;
  if (elf_read_firmware(firmware, &program) != 0) return false;
  avr = avr_make_mcu_by_name("atmega328p");
  if (!avr) return false;
  avr_init(avr);
  avr->frequency = 1000 * CYCLES_PER_MS;
  avr->log = LOG_ERROR;
  program.frequency = avr->frequency;
  avr_load_firmware(avr, &program);
  avr->sleep = sleep_without_waiting;
  avr->flash[SPIN] = 0xFF;  // rjmp .-2
  avr->flash[SPIN + 1] = 0xCF;
  on_said = said;
  on_drove = drove;
  set_jumper(xbee);
  find_uart();
  watch_motors();
  reset();
  return true;
}

static avr_cycle_count_t wake(avr_t *chip, avr_cycle_count_t when, void *param) {
  (void)chip, (void)when, (void)param;
  return 0;
}

// A sleeping chip would pass over `cycle` to its next timer: there is one then.
void chip_run_until(uint64_t cycle) {
  if (!powered) avr->cycle = cycle;
  if (avr->cycle < boots_at) avr->cycle = boots_at < cycle ? boots_at : cycle;
  if (avr->cycle < cycle) avr_cycle_timer_register(avr, cycle - avr->cycle, wake, NULL);
  while (avr->cycle < cycle) {
    const int state = avr_run(avr);
    if (state == cpu_Done || state == cpu_Crashed) {
      fprintf(stderr, "the firmware has crashed at 0x%x\n", avr->pc);
      exit(3);
    }
  }
  look_at_motors();
}

uint64_t chip_cycle(void) { return avr->cycle; }

void chip_power(bool on) {
  powered = on;
  reset();
}

void chip_reset(uint32_t boot_ms) {
  boots_at = avr->cycle + (uint64_t)boot_ms * CYCLES_PER_MS;
  reset();
}

void chip_hang(void) {
  avr->sreg[S_I] = 0;
  avr->state = cpu_Running;
  avr->pc = SPIN;
}

uint64_t chip_character(void) { return powered && avr->cycle >= boots_at ? uart->cycles_per_byte : 0; }

uint32_t chip_baud(void) {
  const uint32_t divisor = (avr->data[UBRR0L] | avr->data[UBRR0H] << 8) + 1;
  return avr->frequency / (avr->data[UCSR0A] & U2X0 ? 8 : 16) / divisor;
}

void chip_hear(uint8_t byte) { avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), byte); }
