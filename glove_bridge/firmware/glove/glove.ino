// SwarmTouch glove on an Arduino UNO: five motors, one serial line. What it does with them is swarmtouch_glove.h.
//
// Wiring, parts and XBee settings: docs/glove.md. The motors' drivers need pull-down resistors: from reset until
// setup() the pins are inputs.

#include <avr/sleep.h>
#include <avr/wdt.h>

#include "swarmtouch_glove.h"

constexpr uint8_t kMotorPins[swarmtouch::kMotors] = {3, 5, 6, 9, 10};  // thumb .. little finger
constexpr uint8_t kXbeeJumper = 7;                                     // to ground: XBee instead of USB

static swarmtouch::Glove glove;

// 8-bit fast PWM at 977 Hz on timers 1 and 2, as timer 0 has it: all motors alike.
static void startPwm() {
  TCCR1A = _BV(WGM10);
  TCCR1B = _BV(WGM12) | _BV(CS11) | _BV(CS10);
  TCCR2A = _BV(WGM21) | _BV(WGM20);
  TCCR2B = _BV(CS22);
}

// Shows what has changed, and only that: writing a pin's duty costs time.
static void drive() {
  static uint8_t shown[swarmtouch::kMotors];
  for (uint8_t motor = 0; motor < swarmtouch::kMotors; ++motor) {
    const uint8_t duty = glove.duty(motor);
    if (duty == shown[motor]) continue;
    analogWrite(kMotorPins[motor], duty);
    shown[motor] = duty;
  }
}

static void receive() {
  while (Serial.available() > 0) {
    if (!glove.feed(static_cast<uint8_t>(Serial.read()), micros())) continue;
    drive();
    const swarmtouch::Reply& reply = glove.reply(micros());
    // A reply that does not fit is dropped, never waited for: the host asks again.
    if (Serial.availableForWrite() >= reply.size()) Serial.write(reply.line(), reply.size());
  }
}

// Sleeps until the next interrupt: a byte, or timer 0 within 1.02 ms. Looks for bytes with interrupts off, or one
// that comes in between would wait for the timer.
static void rest() {
  cli();
  if (Serial.available() == 0) {
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
  }
  sei();
}

// After a reset by the watchdog it still runs, at its shortest; stop it before anything else takes time.
__attribute__((naked, used, section(".init3"))) void stopWatchdog() {
  MCUSR = 0;
  wdt_disable();
}

void setup() {
  for (uint8_t pin : kMotorPins) {
    digitalWrite(pin, LOW);
    pinMode(pin, OUTPUT);
  }
  pinMode(LED_BUILTIN, OUTPUT);
  pinMode(kXbeeJumper, INPUT_PULLUP);
  startPwm();
  set_sleep_mode(SLEEP_MODE_IDLE);
  Serial.begin(digitalRead(kXbeeJumper) == LOW ? swarmtouch::kXbeeBaud : swarmtouch::kUsbBaud);
  wdt_enable(WDTO_120MS);
}

void loop() {
  receive();
  glove.tick(micros());
  drive();
  digitalWrite(LED_BUILTIN, glove.session());
  rest();
  wdt_reset();
}
