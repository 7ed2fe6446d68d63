// Section 5.4 of docs/format.md: estimates of coefficients by small networks (feature bit 15).

/** Number of binary digits of a whole number below 2^53; 0 of 0. */
export function digits(number) {
  const high = Math.floor(number / 2 ** 32);
  return high > 0 ? 64 - Math.clz32(high) : 32 - Math.clz32(number);
}

/** The log-odds that a network gives of some inputs, in units of 2^-11. */
export function estimate({ units, bias }, inputs) {
  const n = inputs.length;
  let sum = bias;
  for (const unit of units) {
    let value = unit[n];
    for (let i = 0; i < n; i++) value += unit[i] * inputs[i];
    if (value > 0) sum += unit[n + 1] * value;
  }
  return Math.min(Math.max(Math.floor(sum / 8192), -24576), 24576);
}

/** The log-odds of a sign: they turn with all inputs from `first` on. */
export function oddEstimate({ units }, inputs, first) {
  const n = inputs.length;
  let sum = 0;
  for (const unit of units) {
    let even = unit[n];
    let odd = 0;
    for (let i = 0; i < first; i++) even += unit[i] * inputs[i];
    for (let i = first; i < n; i++) odd += unit[i] * inputs[i];
    sum += unit[n + 1] * (Math.max(even + odd, 0) - Math.max(even - odd, 0));
  }
  return Math.sign(sum) * Math.min(Math.floor(Math.abs(sum) / 8192), 24576);
}
