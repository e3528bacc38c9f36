// The device that this page is on, as the data of studies describe it.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { type StudyDeviceSchema, StudyPointer } from "../gen/chefshat/v1/study_pb";

/** The device. The server leaves it out if a value is not in its range. */
export function thisDevice(): MessageInitShape<typeof StudyDeviceSchema> {
  return {
    width: Math.round(window.innerWidth),
    height: Math.round(window.innerHeight),
    pixels: Math.round(100 * window.devicePixelRatio),
    pointer: pointer(),
    timeZone: Intl.DateTimeFormat().resolvedOptions().timeZone,
  };
}

function pointer(): StudyPointer {
  const has = (exactness: string) => window.matchMedia(`(any-pointer: ${exactness})`).matches;
  if (has("fine")) return StudyPointer.FINE;
  if (has("coarse")) return StudyPointer.COARSE;
  return has("none") ? StudyPointer.NONE : StudyPointer.UNSPECIFIED;
}
