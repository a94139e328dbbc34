// The chip's end of docs/glove-protocol.md written a second time, to be compared with the firmware's.
//
// Written for clearness: whole frames in vectors, 64-bit time, and what plays looked up from the start each time.

#pragma once

#include <stdint.h>

#include <algorithm>
#include <vector>

using Bytes = std::vector<uint8_t>;

inline uint16_t crcOf(const Bytes& bytes) {
  uint32_t remainder = 0xFFFF;
  for (uint8_t byte : bytes) {
    for (int bit = 7; bit >= 0; --bit) {
      const uint32_t carry = (remainder >> 15 ^ byte >> bit) & 1;
      remainder = (remainder << 1 & 0xFFFF) ^ carry * 0x1021;
    }
  }
  return static_cast<uint16_t>(remainder);
}

inline void append16(Bytes* bytes, unsigned value) {
  bytes->push_back(static_cast<uint8_t>(value >> 8));
  bytes->push_back(static_cast<uint8_t>(value));
}

// `00 COBS(packet crc) 00`, for packets of any length.
inline Bytes framed(Bytes packet) {
  append16(&packet, crcOf(packet));
  Bytes line{0};
  size_t at = 0;
  while (true) {
    const size_t limit = std::min(at + 254, packet.size());
    const size_t zero = std::find(packet.begin() + at, packet.begin() + limit, 0) - packet.begin();
    line.push_back(static_cast<uint8_t>(zero - at + 1));
    line.insert(line.end(), packet.begin() + at, packet.begin() + zero);
    if (zero == packet.size()) break;
    at = zero - at == 254 ? zero : zero + 1;
  }
  line.push_back(0);
  return line;
}

// Undoes COBS; false if the last block is not whole.
inline bool unstuff(const Bytes& line, Bytes* packet) {
  for (size_t at = 0; at < line.size();) {
    const uint8_t code = line[at];
    if (at + code > line.size()) return false;
    packet->insert(packet->end(), line.begin() + at + 1, line.begin() + at + code);
    at += code;
    if (code != 0xFF && at < line.size()) packet->push_back(0);
  }
  return true;
}

class Oracle {
 public:
  bool session() const { return session_; }

  uint8_t duty(int motor, uint64_t nowUs) const {
    if (held_) return frames_[0].duties[motor];
    uint64_t endUs = startUs_;
    for (const Frame& frame : frames_) {
      endUs += frame.us;
      if (nowUs < endUs) return frame.duties[motor];
    }
    return 0;
  }

  void tick(uint64_t nowUs) {
    if (session_ && nowUs - obeyedUs_ >= deadmanUs_) session_ = false;
    if (!session_) rest();
  }

  // Takes a byte; true if it ends a command, whose answer goes to `answer` (without CRC and frame).
  bool feed(uint8_t byte, uint64_t nowUs, Bytes* answer) {
    if (byte != 0) {
      line_.push_back(byte);
      return false;
    }
    if (line_.empty()) return false;
    Bytes packet;
    const bool whole = unstuff(line_, &packet) && packet.size() >= 4 && packet.size() <= 230 && crcOf(packet) == 0;
    line_.clear();
    if (!whole) {
      ++rejected_;
      return false;
    }
    tick(nowUs);
    const Bytes body(packet.begin() + 2, packet.end() - 2);
    *answer = packet[0] == 1 ? greeted(packet[1], body, nowUs) : told(packet[0], packet[1], body, nowUs);
    return true;
  }

 private:
  struct Frame {
    uint64_t us;
    Bytes duties;
  };

  static unsigned at16(const Bytes& bytes, size_t at) { return bytes[at] * 256u + bytes[at + 1]; }

  void rest() {
    frames_.clear();
    held_ = false;
  }

  Bytes greeted(uint8_t seq, const Bytes& body, uint64_t nowUs) {
    if (body.empty() || (body[0] == 2 && body.size() != 5)) return ack(seq, body, 4, nowUs);
    if (body[0] == 2 && !(session_ && nonce_ == at16(body, 1))) {
      rest();
      session_ = true;
      nonce_ = at16(body, 1);
      newest_ = seq;
      obeyedUs_ = nowUs;
      deadmanUs_ = 1000 * std::min(std::max(at16(body, 3), 100u), 2000u);
    }
    Bytes reply{0x81, seq, 2, 2, 0};
    append16(&reply, nonce_);
    reply.push_back(5);
    reply.push_back(32);
    append16(&reply, 10000);
    append16(&reply, static_cast<unsigned>(deadmanUs_ / 1000));
    return reply;
  }

  Bytes told(uint8_t type, uint8_t seq, const Bytes& said, uint64_t nowUs) {
    if (said.size() < 2) return ack(seq, said, 4, nowUs);
    if (!session_ || at16(said, 0) != nonce_) return ack(seq, said, 2, nowUs);
    if (seq == newest_) return ack(seq, said, 1, nowUs);
    if ((seq - newest_ + 256) % 256 > 127) return ack(seq, said, 3, nowUs);
    if (type < 2 || type > 5) return ack(seq, said, 5, nowUs);
    const Bytes body(said.begin() + 2, said.end());
    const bool done = type == 2 ? set(body) : type == 3 ? play(body, nowUs) : body.empty();
    if (!done) return ack(seq, said, 4, nowUs);
    if (type == 4) rest();
    newest_ = seq;
    obeyedUs_ = nowUs;
    return ack(seq, said, 0, nowUs);
  }

  bool set(const Bytes& body) {
    if (body.size() != 5) return false;
    frames_ = {{0, body}};
    held_ = true;
    return true;
  }

  bool play(const Bytes& body, uint64_t nowUs) {
    if (body.empty() || body.size() % 7 != 0) return false;
    std::vector<Frame> frames;
    uint64_t totalUs = 0;
    for (size_t at = 0; at < body.size(); at += 7) {
      frames.push_back({1000u * at16(body, at), Bytes(body.begin() + at + 2, body.begin() + at + 7)});
      if (frames.back().us == 0) return false;
      totalUs += frames.back().us;
    }
    if (totalUs > 10000000) return false;
    frames_ = frames;
    held_ = false;
    startUs_ = nowUs;
    return true;
  }

  // `said` is the body of what is answered: it begins with the session.
  Bytes ack(uint8_t seq, const Bytes& said, uint8_t status, uint64_t nowUs) const {
    uint64_t totalUs = 0;
    for (const Frame& frame : frames_) totalUs += frame.us;
    const uint64_t passedUs = nowUs - startUs_;
    const uint64_t remainingMs = passedUs >= totalUs ? 0 : totalUs / 1000 - passedUs / 1000;
    Bytes reply{0x80, seq};
    append16(&reply, said.size() < 2 ? 0 : at16(said, 0));
    reply.push_back(status);
    append16(&reply, held_ ? 0xFFFF : static_cast<unsigned>(remainingMs));
    append16(&reply, rejected_);
    return reply;
  }

  Bytes line_;  // since the last 0
  uint16_t rejected_ = 0;
  bool session_ = false;
  unsigned nonce_ = 0;
  uint8_t newest_ = 0;
  uint64_t deadmanUs_ = 100000;
  uint64_t obeyedUs_ = 0;
  std::vector<Frame> frames_;  // what plays; one that is held
  bool held_ = false;
  uint64_t startUs_ = 0;
};
