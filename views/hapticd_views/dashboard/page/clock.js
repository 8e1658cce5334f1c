// A moment as the browser's clock shows it, and how far that is from UTC.

/** Such as `14:03:12 +0100`, or `14:03:12.345 +0100`, of a timestamp in seconds. */
export function clock(timestamp, milliseconds = false) {
  const when = new Date(timestamp * 1000), text = when.toTimeString(); // 14:03:12 GMT+0100 (its name)
  const fraction = milliseconds ? `.${String(when.getMilliseconds()).padStart(3, "0")}` : "";
  return `${text.slice(0, 8)}${fraction} ${text.slice(12, 17)}`;
}
