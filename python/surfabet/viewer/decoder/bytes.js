// Errors, and plain fields of the header and of META sections.

/** What is wrong with a file, in words for its user. */
export class SfbError extends Error {
  constructor(message) {
    super(message);
    this.name = "SfbError";
  }
}

/** Stops with what is wrong and where. */
export function fail(section, what) {
  throw new SfbError(`the file is damaged: ${section}: ${what}`);
}

/** Most items of one kind that a page is ready to hold. */
export const MAX_ITEMS = 50e6;

/** Refuses a count before anything is allocated for it. */
export function checkCount(section, what, count, limit = MAX_ITEMS) {
  if (!(count <= limit)) fail(section, `${count} ${what}, more than ${Math.floor(limit)}`);
  return count;
}

/** Most adaptive bits that a stream of so many bytes holds: none takes less than 2^-12 / ln 2 bits. */
export function mostBits(stream) {
  return 22720 * (stream.length + 8);
}

/** Plain fields, little-endian, one after another. */
export class Fields {
  constructor(bytes, section) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.section = section;
    this.at = 0;
  }

  take(n) {
    if (n > this.bytes.length - this.at) {
      fail(this.section, `cut short: ${n} bytes wanted, ${this.bytes.length - this.at} left`);
    }
    this.at += n;
    return this.at - n;
  }

  raw(n) {
    const at = this.take(n);
    return this.bytes.subarray(at, at + n);
  }

  u8() {
    return this.bytes[this.take(1)];
  }

  u32() {
    return this.view.getUint32(this.take(4), true);
  }

  f32() {
    return this.finite(this.view.getFloat32(this.take(4), true));
  }

  f64() {
    return this.finite(this.view.getFloat64(this.take(8), true));
  }

  finite(value) {
    if (!Number.isFinite(value)) fail(this.section, `${value} in the place of a number`);
    return value;
  }

  positive() {
    const value = this.f64();
    if (!(value > 0)) fail(this.section, `${value} where a positive number belongs`);
    return value;
  }

  vector() {
    return [this.f64(), this.f64(), this.f64()];
  }

  /** A varint as BigInt: up to 64 bits. */
  big() {
    let value = 0n;
    for (let i = 0; i < 10; i++) {
      const byte = this.u8();
      value |= BigInt(byte & 127) << BigInt(7 * i);
      if (byte < 128) {
        if ((byte === 0 && i > 0) || value >= 1n << 64n) break;
        return value;
      }
    }
    return fail(this.section, "a varint that is not in its shortest form");
  }

  /** A varint that is at most `limit`; doubles are exact up to 2^53. */
  varint(limit = Number.MAX_SAFE_INTEGER, what = "a number") {
    const value = this.big();
    if (value > BigInt(limit)) fail(this.section, `${what} of ${value}, more than ${limit}`);
    return Number(value);
  }

  /** A signed varint as BigInt. */
  signedBig() {
    const value = this.big();
    return value & 1n ? -((value + 1n) >> 1n) : value >> 1n;
  }

  /** A signed varint within `-limit .. limit`. */
  signed(limit = Number.MAX_SAFE_INTEGER, what = "a number") {
    const value = this.signedBig();
    if (value > BigInt(limit) || value < -BigInt(limit)) {
      fail(this.section, `${what} of ${value}, beyond ${limit} either way`);
    }
    return Number(value);
  }

  end() {
    if (this.at < this.bytes.length) {
      fail(this.section, `${this.bytes.length - this.at} bytes too many at its end`);
    }
  }
}

/** Three doubles: the scale of a scalar (section 3). */
export function readScale(fields) {
  const scale = { low: fields.f64(), high: fields.f64(), step: fields.f64() };
  const steps = (scale.high - scale.low) / scale.step;
  if (!(scale.low <= scale.high && scale.step > 0 && steps <= 2 ** 20 + 1)) {
    fail(fields.section, `a scalar from ${scale.low} to ${scale.high} in steps of ${scale.step}`);
  }
  return scale;
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, i) => {
  let value = i;
  for (let k = 0; k < 8; k++) value = value & 1 ? (value >>> 1) ^ 0x82f63b78 : value >>> 1;
  return value >>> 0;
});

/** CRC-32C. */
export function crc32c(bytes) {
  let value = 0xffffffff;
  for (let i = 0; i < bytes.length; i++) {
    value = CRC_TABLE[(value ^ bytes[i]) & 255] ^ (value >>> 8);
  }
  return (value ^ 0xffffffff) >>> 0;
}
