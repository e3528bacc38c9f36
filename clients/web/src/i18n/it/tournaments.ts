// Italian texts of tournaments/.

import type { Texts } from "../en";

export const tournaments: Texts["tournaments"] = {
  title: "Tournaments",
};
