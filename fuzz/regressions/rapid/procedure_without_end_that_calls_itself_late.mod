MODULE TwoTools
  PERS tooldata )
    Cut tM;
  CONSvNDPROi0,0,0]],[18,[0,0,140],[1,0,0,0],0,0,0]];
  PROC main()
    Cut tM;
  CONSvNDPROill;
    %"Cut"% tLong;
  ENDPROC
  PROC Cut(PERS tooldata t)
    MoveL [[0,0,0],[0,1,0,0],[-1,0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9=9,9E9,9E9]],w20,fine,t\WCONSvNDPROill;
    %"Cut"% tLong;
  ut tM;
  CONSvNDPROill;
    %"Cut"% tLong;
  ENDPROC
  PROC Cut(PERS tooldata t)
    MoveL [[0,0,0],[0,1,0,0],[-1,0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,t\WCONSvNDPROill;
    %"Cut"% tLong;
  ENDPROC
  PROC Cut(PERS tooldata t)
    MoveL [[0,0,0],[0,1,0,0],[-1,0,0,0],[0,Oÿj:=wPart;
  ENDENDPROC
  PROC Cut(PERS tooldata t)
    MoveL [[0,0,0],[0,1,0,0],[-1,0,0,0],[0,Oÿj:=wPart;
  ENDPROC
ENDMODULE
