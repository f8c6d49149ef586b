// One time for the whole page: who shows it listens, who changes it announces it.

const TIME = "uqmbd-time";

let latest = null;
document.addEventListener(TIME, ({ detail }) => (latest = Number.isFinite(detail.time) ? detail.time : latest));

/** The time of the page, in seconds; null before anyone has announced one. */
export const pageTime = () => latest;

/** Tell all others that the page is at a time, in seconds; `source` is who says so. */
export function announceTime(time, source) {
  document.dispatchEvent(new CustomEvent(TIME, { detail: { time, source } }));
}

/** Call `listener(time)` when someone other than `self` announces a time. */
export function onTime(self, listener) {
  document.addEventListener(TIME, (event) => {
    const { time, source } = event.detail;
    if (source !== self && Number.isFinite(time)) listener(time);
  });
}
