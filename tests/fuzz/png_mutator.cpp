// SPDX-License-Identifier: MIT
// Mutations that checksums do not turn away: chunks are mutated one by one, pixels below the
// compression, and most files get the right checksums again.
#include "png_mutator.hpp"

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include <libdeflate.h>

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data,
                                               std::size_t size,
                                               std::size_t max_size,
                                               unsigned seed);

namespace stemvo::fuzz {
namespace {

using Buffer = std::vector<std::uint8_t>;

constexpr std::size_t kSignature = 8;
constexpr std::size_t kFrame = 12;           // of a chunk: length, type, checksum
constexpr std::size_t kMaxUnpacked = 65536;  // of pixels

struct Chunk {
  Buffer type_and_data;
  bool is_sound = true;
};

std::uint32_t be32(const std::uint8_t* bytes) {
  return (std::uint32_t{bytes[0]} << 24U) | (std::uint32_t{bytes[1]} << 16U) |
         (std::uint32_t{bytes[2]} << 8U) | std::uint32_t{bytes[3]};
}

void add_be32(Buffer& out, std::size_t value) {
  for (const unsigned shift : {24U, 16U, 8U, 0U}) {
    out.push_back(static_cast<std::uint8_t>(value >> shift));
  }
}

std::vector<Chunk> chunks_of(io::Bytes bytes) {
  std::vector<Chunk> chunks;
  std::size_t at = kSignature;
  while (bytes.size() >= at + kFrame && be32(&bytes[at]) <= bytes.size() - at - kFrame) {
    const std::size_t size = be32(&bytes[at]) + 4;
    const io::Bytes checked = bytes.subspan(at + 4, size);
    chunks.push_back({Buffer(checked.begin(), checked.end()),
                      libdeflate_crc32(0, checked.data(), size) == be32(&bytes[at + 4 + size])});
    at += size + 8;
  }
  return chunks;
}

Buffer file_of(const std::vector<Chunk>& chunks, io::Bytes signature) {
  Buffer out(signature.begin(), signature.end());
  for (const Chunk& chunk : chunks) {
    const Buffer& bytes = chunk.type_and_data;
    add_be32(out, bytes.size() - 4);
    out.insert(out.end(), bytes.begin(), bytes.end());
    const std::uint32_t checksum = libdeflate_crc32(0, bytes.data(), bytes.size());
    add_be32(out, chunk.is_sound ? checksum : ~checksum);
  }
  return out;
}

void mutate(Buffer& bytes, std::size_t min_size, std::size_t room) {
  const std::size_t old_size = bytes.size();
  bytes.resize(old_size + room);
  bytes.resize(LLVMFuzzerMutate(bytes.data(), old_size, bytes.size()));
  bytes.resize(std::max(bytes.size(), min_size));
}

bool is_pixels(const Chunk& chunk) {
  return std::string(chunk.type_and_data.begin(), chunk.type_and_data.begin() + 4) == "IDAT";
}

/// Unpacks the pixels, mutates them, and packs them into two chunks.
void mutate_pixels(std::vector<Chunk>& chunks) {
  Buffer packed;
  for (const Chunk& chunk : chunks) {
    if (is_pixels(chunk)) {
      packed.insert(packed.end(), chunk.type_and_data.begin() + 4, chunk.type_and_data.end());
    }
  }
  Buffer pixels(kMaxUnpacked);
  std::size_t size = 0;
  static libdeflate_decompressor* const unpacker = libdeflate_alloc_decompressor();
  static libdeflate_compressor* const packer = libdeflate_alloc_compressor(1);
  if (libdeflate_zlib_decompress(unpacker, packed.data(), packed.size(), pixels.data(),
                                 pixels.size(), &size) != LIBDEFLATE_SUCCESS) {
    return;
  }
  pixels.resize(size);
  mutate(pixels, 1, 64);
  packed.resize(libdeflate_zlib_compress_bound(packer, pixels.size()));
  packed.resize(
      libdeflate_zlib_compress(packer, pixels.data(), pixels.size(), packed.data(), packed.size()));
  const auto first = std::ranges::find_if(chunks, is_pixels);
  const auto at = static_cast<std::size_t>(first - chunks.begin());
  std::erase_if(chunks, is_pixels);
  const auto half = static_cast<std::ptrdiff_t>(packed.size() / 2);
  Chunk front{{'I', 'D', 'A', 'T'}};
  Chunk back = front;
  front.type_and_data.insert(front.type_and_data.end(), packed.begin(), packed.begin() + half);
  back.type_and_data.insert(back.type_and_data.end(), packed.begin() + half, packed.end());
  const auto place = chunks.begin() + static_cast<std::ptrdiff_t>(std::min(at, chunks.size()));
  chunks.insert(place, {front, back});
}

}  // namespace

bool is_large_png(io::Bytes bytes) {
  constexpr std::uint64_t kMaxPixels = 1U << 16U;
  constexpr std::size_t kSize = 16;  // of IHDR: width and height
  return bytes.size() >= kSize + 8 &&
         std::uint64_t{be32(&bytes[kSize])} * be32(&bytes[kSize + 4]) > kMaxPixels;
}

}  // namespace stemvo::fuzz

std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data,
                                    std::size_t size,
                                    std::size_t max_size,
                                    unsigned seed) {
  using namespace stemvo::fuzz;
  const stemvo::io::Bytes bytes(data, size);
  std::minstd_rand random(seed);
  if (!stemvo::io::is_png(bytes) || random() % 16 == 0) {
    return LLVMFuzzerMutate(data, size, max_size);
  }
  std::vector<Chunk> chunks = chunks_of(bytes);
  if (chunks.empty()) {
    return LLVMFuzzerMutate(data, size, max_size);
  }
  Chunk& chunk = chunks[random() % chunks.size()];
  switch (random() % 8) {
    case 0:
      std::swap(chunk, chunks[random() % chunks.size()]);
      break;
    case 1: {
      const Chunk copy = chunk;
      chunks.insert(chunks.begin() + static_cast<std::ptrdiff_t>(random() % chunks.size()), copy);
      break;
    }
    case 2:
      chunk.is_sound = !chunk.is_sound;
      break;
    case 3:
    case 4:
      mutate(chunk.type_and_data, 4, 32);
      break;
    default:
      mutate_pixels(chunks);
  }
  const Buffer file = file_of(chunks, bytes.first(kSignature));
  if (file.size() > max_size) {
    return size;
  }
  std::ranges::copy(file, data);
  return file.size();
}
