// Clients for studies: a service for participants and one for researchers. They are not among those
// of every page, because most visitors need neither.

import { createClient } from "@connectrpc/connect";
import { transport } from "../api/client";
import { ParticipationService, StudyService } from "../gen/chefshat/v1/study_service_pb";

/** Taking part in a study. */
export const participationApi = createClient(ParticipationService, transport);
/** Studies, for researchers. */
export const studyApi = createClient(StudyService, transport);
