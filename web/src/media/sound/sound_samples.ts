const BIAS = 0x84;

/** G.711 µ-law, one byte a sample, to −1 … 1. */
export function decodeMuLaw(bytes: Uint8Array): Float32Array<ArrayBuffer> {
  return Float32Array.from(bytes, (byte) => {
    const code = ~byte & 0xff;
    const size = ((((code & 0x0f) << 3) + BIAS) << ((code & 0x70) >> 4)) - BIAS;
    return (code & 0x80 ? -size : size) / 32768;
  });
}

/** At a higher rate, each sample drawn to the next in a straight line. */
export function atRate(
  samples: Float32Array<ArrayBuffer>,
  rate: number,
  wanted: number,
): Float32Array<ArrayBuffer> {
  if (rate === wanted) return samples;
  return Float32Array.from({ length: Math.round((samples.length * wanted) / rate) }, (_, at) => {
    const place = (at * rate) / wanted;
    const left = samples[Math.floor(place)] ?? 0;
    const right = samples[Math.floor(place) + 1] ?? left;
    return left + (right - left) * (place % 1);
  });
}

/** Channels of an Opus packet, from its first byte (RFC 6716 3.1). */
export function opusChannels(packet: Uint8Array): 1 | 2 {
  return ((packet[0] ?? 0) & 0x04) === 0 ? 1 : 2;
}

/** "−23 dB": of full scale. */
export function levelOf(samples: Float32Array): number {
  if (samples.length === 0) return -Infinity;
  const power = samples.reduce((sum, sample) => sum + sample * sample, 0) / samples.length;
  return power === 0 ? -Infinity : 10 * Math.log10(power);
}
