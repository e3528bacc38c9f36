// Text as large as its box allows, for the wall view: finds the largest size at which everything
// fits.

import type { RefObject } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";

/** Smallest size, pixels: text too small to read is still not cut off. */
const SMALLEST = 8;
/** Largest size, as a share of the window's height: a name is a line of a table, not a headline. */
const LARGEST = 0.075;
/** Halvings of the range between them, which find the size to less than a pixel. */
const STEPS = 8;
/**
 * Taken off the size that fits, pixels: the measures are rounded, so that half a pixel may be too
 * much, which would cut off a border. It is this much per em of a content of 8 em.
 */
const SPARE = 1 / 16;

/** A box with the largest type that fits it. Its content is sized in `em`. */
export function useFit<Box extends HTMLElement>(): RefObject<Box | null> {
  const box = useRef<Box>(null);
  // After each render, since anything in it may have changed.
  useLayoutEffect(() => {
    const fitted = box.current;
    if (!fitted) return;
    fitTo(fitted);
    const watch = new ResizeObserver(() => fitTo(fitted));
    watch.observe(fitted);
    // The page's font may load after the text is rendered.
    void document.fonts.ready.then(() => fitTo(fitted));
    return () => watch.disconnect();
  });
  return box;
}

/** Sets the largest font size at which the content of a box fits. */
export function fitTo(box: HTMLElement): void {
  let [small, large] = [SMALLEST, Math.max(SMALLEST, LARGEST * window.innerHeight)];
  for (let step = 0; step < STEPS; step += 1) {
    const tried = (small + large) / 2;
    box.style.fontSize = `${tried}px`;
    if (box.scrollHeight <= box.clientHeight && box.scrollWidth <= box.clientWidth) small = tried;
    else large = tried;
  }
  box.style.fontSize = `${small - SPARE}px`;
}
