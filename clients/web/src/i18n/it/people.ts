// Italian texts of people/.

import type { Texts } from "../en";

export const people: Texts["people"] = {
  title: "People",
};
