// One time for the whole page: who shows it listens, who changes it announces it.

const TIME = "uqmbd-time";

let latest = null;
const remember = ({ detail }) => (latest = Number.isFinite(detail.time) ? detail.time : latest);

// times are events of the document, so that other scripts of a page receive them, too
let told = document;
told.addEventListener(TIME, remember);

/** Let what these scripts draw have a time of its own, which others do not hear: an output among those of a notebook. */
export function ownTime() {
  told.removeEventListener(TIME, remember);
  told = new EventTarget();
  told.addEventListener(TIME, remember);
}

/** The time of the page, in seconds; null before anyone has announced one. */
export const pageTime = () => latest;

let proposed = null;

/** Where the page is to begin, if anything in it moves. */
export const proposeTime = (time) => (proposed ??= time);

/** The time of the page; where nobody has announced one, it begins at the one that was proposed, or at this one. */
export const beginAt = (time) => (latest ??= proposed ?? time);

/** Tell all others that the page is at a time, in seconds; `source` is who says so. */
export function announceTime(time, source) {
  told.dispatchEvent(new CustomEvent(TIME, { detail: { time, source } }));
}

/** Call `listener(time)` when someone other than `self` announces a time. */
export function onTime(self, listener) {
  told.addEventListener(TIME, (event) => {
    const { time, source } = event.detail;
    if (source !== self && Number.isFinite(time)) listener(time);
  });
}
