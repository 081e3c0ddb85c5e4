/PROG  CONTOUR
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "deflex";
PROG_SIZE	= 0;
CREATE		= DATE 26-01-05  TIME 10:00:00;
MODIFIED	= DATE 26-01-05  TIME 10:00:00;
FILE_NAME	= ;
VERSION		= 0;
LINE_COUNT	= 37;
MEMORY_SIZE	= 0;
PROTECT		= READ_WRITE;
TCD:  STACK_SIZE	= 0,
      TASK_PRIORITY	= 50,
      TIME_SLICE	= 0,
      BUSY_LAMP_OFF	= 0,
      ABORT_REQUEST	= 0,
      PAUSE_REQUEST	= 0;
DEFAULT_GROUP	= 1,*,*,*,*;
CONTROL_CODE	= 00000000 00000000;
/MN
   1:  !posted for the samples of deflex ;
   2:  UFRAME_NUM=1 ;
   3:  UTOOL_NUM=1 ;
   4:  !deflex air ;
   5:J P[1] 20% FINE     ;
   6:L P[2] 100mm/sec FINE     ;
   7:  !deflex cut ;
   8:L P[3] 30mm/sec CNT100     ;
   9:L P[4] 30mm/sec CNT100     ;
  10:L P[5] 30mm/sec CNT100     ;
  11:L P[6] 30mm/sec CNT100     ;
  12:L P[7] 30mm/sec CNT100     ;
  13:L P[8] 30mm/sec CNT100     ;
  14:L P[9] 30mm/sec CNT100     ;
  15:L P[10] 30mm/sec CNT100     ;
  16:L P[11] 30mm/sec CNT100     ;
  17:L P[12] 30mm/sec CNT100     ;
  18:C P[13]    
    :  P[14] 30mm/sec CNT100     ;
  19:L P[15] 30mm/sec CNT100     ;
  20:L P[16] 30mm/sec CNT100     ;
  21:L P[17] 30mm/sec CNT100     ;
  22:C P[18]    
    :  P[19] 30mm/sec CNT100     ;
  23:L P[20] 30mm/sec CNT100     ;
  24:L P[21] 30mm/sec CNT100     ;
  25:L P[22] 30mm/sec CNT100     ;
  26:L P[23] 30mm/sec CNT100     ;
  27:L P[24] 30mm/sec CNT100     ;
  28:L P[25] 30mm/sec CNT100     ;
  29:C P[26]    
    :  P[27] 30mm/sec CNT100     ;
  30:L P[28] 30mm/sec CNT100     ;
  31:L P[29] 30mm/sec CNT100     ;
  32:L P[30] 30mm/sec CNT100     ;
  33:L P[31] 30mm/sec CNT100     ;
  34:L P[32] 30mm/sec CNT100     ;
  35:L P[33] 30mm/sec CNT100     ;
  36:  !deflex air ;
  37:L P[34] 100mm/sec FINE     ;
/POS
P[1]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =   -20.000  mm,	Y =     0.000  mm,	Z =    50.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[2]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =   -20.000  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[3]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =   -10.500  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[4]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    -1.000  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[5]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     8.500  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[6]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    18.000  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[7]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    27.500  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[8]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    37.000  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[9]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    46.500  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[10]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    56.000  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[11]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    65.500  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[12]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    75.000  mm,	Y =     0.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[13]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    85.607  mm,	Y =     4.393  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[14]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    90.000  mm,	Y =    15.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[15]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    90.000  mm,	Y =    25.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[16]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    90.000  mm,	Y =    35.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[17]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    90.000  mm,	Y =    45.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[18]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    85.607  mm,	Y =    55.607  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[19]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    75.000  mm,	Y =    60.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[20]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    65.000  mm,	Y =    60.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[21]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    55.000  mm,	Y =    60.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[22]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    45.000  mm,	Y =    60.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[23]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    35.000  mm,	Y =    60.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[24]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    25.000  mm,	Y =    60.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[25]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =    15.000  mm,	Y =    60.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[26]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     4.393  mm,	Y =    55.607  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[27]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     0.000  mm,	Y =    45.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[28]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     0.000  mm,	Y =    34.167  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[29]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     0.000  mm,	Y =    23.333  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[30]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     0.000  mm,	Y =    12.500  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[31]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     0.000  mm,	Y =     1.667  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[32]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     0.000  mm,	Y =    -9.167  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[33]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     0.000  mm,	Y =   -20.000  mm,	Z =    -2.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
P[34]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =     0.000  mm,	Y =   -20.000  mm,	Z =    50.000  mm,
	W =   180.000 deg,	P =     0.000 deg,	R =     0.000 deg
};
/END
