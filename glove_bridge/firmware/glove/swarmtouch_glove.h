// The glove's firmware without the hardware: what it hears, says, and does with five motors.
//
// No I/O and no clock: bytes and the time come in, duties and replies go out, so that the same code runs on the
// ATmega328P and, under a fuzzer, on a desk. The host's end is glove_bridge/protocol.py and framing.py; the words
// are explained there, and docs/glove-protocol.md has every byte. Times are microseconds that may wrap around.

#pragma once

#include <stdint.h>

namespace swarmtouch {

constexpr uint8_t kProtocol = 2;
constexpr uint8_t kFirmwareMajor = 2;
constexpr uint8_t kFirmwareMinor = 0;
constexpr uint8_t kMotors = 5;
constexpr uint8_t kMaxFrames = 32;
constexpr uint16_t kMaxPatternMs = 10000;
constexpr uint16_t kMinDeadmanMs = 100;
constexpr uint16_t kMaxDeadmanMs = 2000;
constexpr uint32_t kUsbBaud = 115200;
constexpr uint32_t kXbeeBaud = 57600;
constexpr uint16_t kHeld = 0xFFFF;

enum Type : uint8_t {
  kHello = 0x01,
  kSet = 0x02,
  kPlay = 0x03,
  kStop = 0x04,
  kPing = 0x05,
  kAck = 0x80,
  kHelloReply = 0x81,
};

enum Status : uint8_t {
  kOk = 0,
  kDuplicate = 1,
  kNoSession = 2,
  kStale = 3,
  kBadBody = 4,
  kUnknownType = 5,
};

constexpr uint8_t kFrameSize = 2 + kMotors;
constexpr uint8_t kHead = 2;     // type, seq
constexpr uint8_t kSession = 2;  // its nonce; not in a greeting, whose form is the same in every version
constexpr uint8_t kCrc = 2;
constexpr uint8_t kMaxPacket = kHead + kSession + kFrameSize * kMaxFrames + kCrc;
constexpr uint8_t kMaxReply = kHead + 11 + kCrc;  // HELLO's
static_assert(kMaxPacket < 254, "COBS must add one byte only");

inline uint16_t read16(const uint8_t* at) { return static_cast<uint16_t>(at[0] << 8 | at[1]); }

// CRC-16/CCITT, polynomial 0x1021. Over a packet and its own CRC it is 0.
inline uint16_t crcStep(uint16_t crc, uint8_t byte) {
  crc ^= static_cast<uint16_t>(byte << 8);
  for (uint8_t bit = 0; bit < 8; ++bit) {
    crc = static_cast<uint16_t>(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
  }
  return crc;
}

constexpr uint16_t kCrcStart = 0xFFFF;

// Finds packets in a stream of bytes. Decodes as they come: after the last byte little is left to do.
class Receiver {
 public:
  // Takes a byte. Returns whether it ended a whole packet, which is there until the next byte, or kept.
  bool feed(uint8_t byte) {
    if (finished_) start();
    if (byte == 0) return finish();
    empty_ = false;
    if (left_ > 0) {
      --left_;
      append(byte);
    } else {
      if (code_ != kNoZero) append(0);
      code_ = byte;
      left_ = static_cast<uint8_t>(byte - 1);
    }
    return false;
  }

  // Keeps the packet where it is until another one is kept: what plays need not be copied.
  void keep() { keep_ = true; }

  uint8_t type() const { return packet()[0]; }
  uint8_t seq() const { return packet()[1]; }
  const uint8_t* body() const { return packet() + kHead; }
  uint8_t bodySize() const { return static_cast<uint8_t>(size_ - kHead - kCrc); }
  uint16_t rejected() const { return rejected_; }

 private:
  static constexpr uint8_t kNoZero = 0xFF;  // the COBS code after which no zero is implied

  const uint8_t* packet() const { return packets_[current_]; }

  void start() {
    if (keep_) current_ ^= 1;
    keep_ = false;
    size_ = left_ = 0;
    code_ = kNoZero;
    crc_ = kCrcStart;
    empty_ = true;
    finished_ = overflow_ = false;
  }

  void append(uint8_t byte) {
    overflow_ = overflow_ || size_ == kMaxPacket;
    if (overflow_) return;
    packets_[current_][size_++] = byte;
    crc_ = crcStep(crc_, byte);
  }

  bool finish() {
    finished_ = true;
    const bool whole = left_ == 0 && !overflow_ && size_ >= kHead + kCrc && crc_ == 0;
    if (!whole && !empty_) ++rejected_;
    return whole;
  }

  uint8_t packets_[2][kMaxPacket];
  uint8_t current_ = 0;
  uint8_t size_ = 0;
  uint8_t left_ = 0;  // until the next COBS code
  uint8_t code_ = kNoZero;
  uint16_t crc_ = kCrcStart;
  uint16_t rejected_ = 0;
  bool empty_ = true;
  bool overflow_ = false;
  bool finished_ = false;
  bool keep_ = false;
};

// A reply as it goes on the line, `00 COBS(packet crc) 00`, encoded as it is put together.
class Reply {
 public:
  Reply& start(uint8_t type, uint8_t seq) {
    line_[0] = 0;
    code_ = 1;
    size_ = 2;
    crc_ = kCrcStart;
    return put(type).put(seq);
  }

  Reply& put(uint8_t byte) {
    crc_ = crcStep(crc_, byte);
    if (byte == 0) {
      endBlock();
    } else {
      line_[size_++] = byte;
    }
    return *this;
  }

  Reply& put16(uint16_t value) { return put(static_cast<uint8_t>(value >> 8)).put(static_cast<uint8_t>(value)); }

  void finish() {
    put16(crc_);
    endBlock();
    line_[code_] = 0;
  }

  const uint8_t* line() const { return line_; }
  uint8_t size() const { return size_; }

 private:
  // Writes how far it is to the next zero where COBS wants that, and makes room for the next such code.
  void endBlock() {
    line_[code_] = static_cast<uint8_t>(size_ - code_);
    code_ = size_++;
  }

  uint8_t line_[kMaxReply + 3];
  uint8_t code_ = 1;  // where the code of the current block goes
  uint8_t size_ = 0;
  uint16_t crc_ = kCrcStart;
};

// Plays a pattern frame by frame, or holds duties. Each frame starts where the one before ended: nothing drifts.
class Player {
 public:
  // Takes `count` frames as they are on the line, where they must stay; false if one is empty or all are too long.
  bool play(const uint8_t* frames, uint8_t count, uint32_t nowUs) {
    uint16_t totalMs = 0;
    for (const uint8_t* frame = frames; frame != frames + count * kFrameSize; frame += kFrameSize) {
      const uint16_t ms = read16(frame);
      if (ms == 0 || ms > kMaxPatternMs - totalMs) return false;
      totalMs = static_cast<uint16_t>(totalMs + ms);
    }
    duties_ = frames + 2;
    left_ = count;
    totalMs_ = totalMs;
    startUs_ = frameUs_ = nowUs;
    return true;
  }

  // Takes five duties, which must stay where they are.
  void hold(const uint8_t* duties) {
    duties_ = duties;
    left_ = 0;
  }

  void stop() { duties_ = nullptr; }

  void tick(uint32_t nowUs) {
    while (playing() && nowUs - frameUs_ >= lengthUs()) {
      frameUs_ += lengthUs();
      duties_ = --left_ > 0 ? duties_ + kFrameSize : nullptr;
    }
  }

  uint8_t duty(uint8_t motor) const { return duties_ != nullptr ? duties_[motor] : 0; }

  uint16_t remainingMs(uint32_t nowUs) const {
    if (!playing()) return duties_ != nullptr ? kHeld : 0;
    return static_cast<uint16_t>(totalMs_ - (nowUs - startUs_) / 1000);
  }

 private:
  bool playing() const { return duties_ != nullptr && left_ > 0; }
  uint32_t lengthUs() const { return 1000UL * read16(duties_ - 2); }

  const uint8_t* duties_ = nullptr;  // of the frame that plays, or held; none: the motors rest
  uint8_t left_ = 0;                 // frames, with the one that plays; 0 when held
  uint16_t totalMs_ = 0;
  uint32_t startUs_ = 0;
  uint32_t frameUs_ = 0;  // when the frame started
};

// The whole glove: obeys what it hears and falls silent when it hears nothing.
class Glove {
 public:
  // Takes a byte from the line. Returns whether it ended a command, which is obeyed; reply() answers it.
  bool feed(uint8_t byte, uint32_t nowUs) {
    if (!receiver_.feed(byte)) return false;
    tick(nowUs);
    status_ = obey(nowUs);
    return true;
  }

  // Moves on to `nowUs`: the next frame, the end of a pattern, the dead-man.
  void tick(uint32_t nowUs) {
    player_.tick(nowUs);
    if (session_ && nowUs - obeyedUs_ >= 1000UL * deadmanMs_) {
      session_ = false;
      player_.stop();
    }
  }

  // Answers the command that has just been fed. Apart from feed(), so that the motors need not wait for it.
  const Reply& reply(uint32_t nowUs) {
    if (receiver_.type() == kHello && status_ == kOk) {
      reply_.start(kHelloReply, receiver_.seq()).put(kProtocol).put(kFirmwareMajor).put(kFirmwareMinor);
      reply_.put16(nonce_).put(kMotors).put(kMaxFrames).put16(kMaxPatternMs).put16(deadmanMs_).finish();
    } else {
      reply_.start(kAck, receiver_.seq()).put16(commandSession()).put(status_).put16(player_.remainingMs(nowUs));
      reply_.put16(receiver_.rejected()).finish();
    }
    return reply_;
  }

  uint8_t duty(uint8_t motor) const { return player_.duty(motor); }
  bool session() const { return session_; }

 private:
  // Whatever is not obeyed, however whole, must not keep the motors alive: only what returns kOk feeds the dead-man.
  Status obey(uint32_t nowUs) {
    if (receiver_.type() == kHello) return hello(nowUs);
    if (receiver_.bodySize() < kSession) return kBadBody;
    if (!session_ || commandSession() != nonce_) return kNoSession;
    const int8_t ahead = static_cast<int8_t>(receiver_.seq() - newest_);
    if (ahead <= 0) return ahead == 0 ? kDuplicate : kStale;
    const Status status = act(receiver_.body() + kSession, receiver_.bodySize() - kSession, nowUs);
    if (status != kOk) return status;
    newest_ = receiver_.seq();
    obeyedUs_ = nowUs;
    return kOk;
  }

  // What the command says of its session; an answer repeats it, so that a host knows its own.
  uint16_t commandSession() const { return receiver_.bodySize() < kSession ? 0 : read16(receiver_.body()); }

  // Opens a session, unless it is open. To another version it only says its own.
  Status hello(uint32_t nowUs) {
    const uint8_t* body = receiver_.body();
    if (receiver_.bodySize() == 0) return kBadBody;
    if (body[0] != kProtocol) return kOk;
    if (receiver_.bodySize() != 5) return kBadBody;
    const uint16_t nonce = read16(body + 1), deadmanMs = read16(body + 3);
    if (session_ && nonce == nonce_) return kOk;
    player_.stop();
    session_ = true;
    nonce_ = nonce;
    newest_ = receiver_.seq();
    obeyedUs_ = nowUs;
    deadmanMs_ = deadmanMs < kMinDeadmanMs ? kMinDeadmanMs : deadmanMs > kMaxDeadmanMs ? kMaxDeadmanMs : deadmanMs;
    return kOk;
  }

  Status act(const uint8_t* body, uint8_t size, uint32_t nowUs) {
    switch (receiver_.type()) {
      case kSet:
        if (size != kMotors) return kBadBody;
        player_.hold(body);
        receiver_.keep();
        return kOk;
      case kPlay:
        if (size == 0 || size % kFrameSize != 0) return kBadBody;
        if (!player_.play(body, size / kFrameSize, nowUs)) return kBadBody;
        receiver_.keep();
        return kOk;
      case kStop:
        if (size != 0) return kBadBody;
        player_.stop();
        return kOk;
      case kPing:
        return size == 0 ? kOk : kBadBody;
      default:
        return kUnknownType;
    }
  }

  Receiver receiver_;
  Player player_;
  Reply reply_;
  Status status_ = kOk;
  bool session_ = false;
  uint16_t nonce_ = 0;
  uint16_t deadmanMs_ = kMinDeadmanMs;
  uint8_t newest_ = 0;  // seq of the newest command obeyed
  uint32_t obeyedUs_ = 0;
};

}  // namespace swarmtouch
