// Fuzzes the firmware's parser and player on the host, against a second implementation of the protocol.
//
// An input is a script, one byte per operation: 00..7f lets (n + 1)^2 / 8 ms pass, 80..bf feeds the next n - 0x80
// bytes as they are, c0..fe feeds a whole frame of the next n - 0xc0 bytes, ff one whose length is in the next byte,
// so that not only the parser is tried. After every byte and every wait, answers and duties are compared.

#include <stdio.h>
#include <stdlib.h>

#include <algorithm>

#include "oracle.h"
#include "swarmtouch_glove.h"

#define REQUIRE(condition)                             \
  do {                                                 \
    if (!(condition)) {                                \
      fprintf(stderr, "violated: %s\n", #condition);   \
      abort();                                         \
    }                                                  \
  } while (false)

namespace {

constexpr uint64_t kStartUs = 0xFFF00000;  // the chip's 32 bits wrap around soon
constexpr uint64_t kCharacterUs = 87;

class Bench {
 public:
  void wait(uint64_t us) {
    nowUs_ += us;
    tick();
  }

  void feed(uint8_t byte) {
    nowUs_ += kCharacterUs;
    const uint32_t now = static_cast<uint32_t>(nowUs_);
    const bool answered = glove_.feed(byte, now);
    Bytes expected;
    REQUIRE(oracle_.feed(byte, nowUs_, &expected) == answered);
    if (answered) {
      // type, seq, session, status: an acknowledgement of something obeyed; a greeting leaves every motor off.
      if (expected[0] == swarmtouch::kAck && expected[4] == swarmtouch::kOk) lastObeyedUs_ = nowUs_;
      const swarmtouch::Reply& reply = glove_.reply(now);
      REQUIRE(Bytes(reply.line(), reply.line() + reply.size()) == framed(expected));
    }
    tick();
  }

 private:
  void tick() {
    glove_.tick(static_cast<uint32_t>(nowUs_));
    oracle_.tick(nowUs_);
    REQUIRE(glove_.session() == oracle_.session());
    bool on = false;
    for (uint8_t motor = 0; motor < swarmtouch::kMotors; ++motor) {
      REQUIRE(glove_.duty(motor) == oracle_.duty(motor, nowUs_));
      on = on || glove_.duty(motor) != 0;
    }
    // Whatever both think: a motor is never on for longer than this without a command that was obeyed.
    REQUIRE(!on || nowUs_ - lastObeyedUs_ < 1000u * swarmtouch::kMaxDeadmanMs);
  }

  swarmtouch::Glove glove_;
  Oracle oracle_;
  uint64_t nowUs_ = kStartUs;
  uint64_t lastObeyedUs_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Bench bench;
  const uint8_t* const end = data + size;
  while (data < end) {
    const uint8_t operation = *data++;
    if (operation < 0x80) {
      bench.wait((operation + 1) * (operation + 1) * 125);
      continue;
    }
    const size_t wanted = operation == 0xFF && data < end ? *data++ : operation & 0x3F;
    const Bytes bytes(data, data + std::min<size_t>(wanted, end - data));
    data += bytes.size();
    for (uint8_t byte : operation < 0xC0 ? bytes : framed(bytes)) bench.feed(byte);
  }
  return 0;
}
